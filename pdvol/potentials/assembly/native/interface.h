/* The functions of assembly that Python uses. C includes this file, and Python reads it (pdvol/compiled.py). */
#ifndef PDVOL_ASSEMBLY_INTERFACE_H
#define PDVOL_ASSEMBLY_INTERFACE_H
#include <stdint.h>

double cell_values(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                   const double *volumes, const double *parameters, int np, int at);
void cell_gradients(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                    const double *volumes, const double *parameters, int np, int at, double *out);
int64_t cell_hessians(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                      const double *volumes, const double *parameters, int np, int at, const int32_t *slots, int mode,
                      double weight, double *out);
int64_t isotropic_hessians(void *gradient, void *hessian, const int32_t *arguments, int ng, int nh, int64_t count,
                           const int32_t *dofs, const double *x, const double *inverse, const double *volumes,
                           const double *parameters, int np, const int32_t *slots, int mode, double weight,
                           double *out);
int64_t merge_pairs(int d, int64_t rows, int64_t first, int64_t n, const int32_t *cell_starts,
                    const int32_t *cell_columns, const double *cells, int64_t pairs, const int64_t *pair_rows,
                    const int64_t *pair_columns, const double *pair_blocks, const uint8_t *fixed, int32_t *starts,
                    int32_t *columns, double *blocks);
int64_t inverted_cells(int d, int64_t count, const int32_t *dofs, const double *x);
double volume_step(int d, int64_t count, const int32_t *dofs, const double *x, const double *p, double keep);
#endif
