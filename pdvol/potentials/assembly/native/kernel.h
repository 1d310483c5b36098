/* The signature of FFCx's cell kernels, which got a seventh argument in dolfinx 0.10. */
#ifndef PDVOL_KERNEL_H
#define PDVOL_KERNEL_H
#include <stdint.h>

#ifndef KERNEL_ARGUMENTS
#define KERNEL_ARGUMENTS 6
#endif
#if KERNEL_ARGUMENTS == 6
typedef void (*kernel_t)(double *, const double *, const double *, const double *, const int *, const uint8_t *);
#define CALL(k, A, w, c, x) ((kernel_t)(k))(A, w, c, x, 0, 0)
#else
typedef void (*kernel_t)(double *, const double *, const double *, const double *, const int *, const uint8_t *, void *);
#define CALL(k, A, w, c, x) ((kernel_t)(k))(A, w, c, x, 0, 0, 0)
#endif
/* What kernels are called on: corners of the unit triangle or tetrahedron, three numbers each. */
static const double unit_simplex[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
#endif
