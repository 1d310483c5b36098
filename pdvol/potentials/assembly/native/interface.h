/* The structures and functions of assembly that Python uses. C includes this file, and Python reads it (pdvol/compiled.py). */
#ifndef PDVOL_ASSEMBLY_INTERFACE_H
#define PDVOL_ASSEMBLY_INTERFACE_H
#include <stdint.h>

/* Cells: where their vertices are in arrays of vertices (count, d + 1), the inverse of their edges at rest (count, d, d; row i is the gradient of hat
 * function i + 1), and their volumes. The first `counted` of them count in sums of this rank. */
typedef struct {
    int32_t d;
    int64_t count, counted;
    const int32_t *vertices;
    const double *inverse, *volumes;
} cells_t;

/* A compiled kernel of a density psi(F) or of its derivatives, and the cells' parameters (count, np). The kernel takes F before parameter `at`, or
 * not at all where `at` is negative. */
typedef struct {
    void *kernel;
    const double *parameters;
    int32_t np, at;
} density_t;

/* Compiled kernels of the first and second derivatives of an isotropic density by the stretches, and the cells' parameters (count, np).
 * arguments[i] says where in (stretches, parameters) their i-th coefficient is found, for the gradient first (ng), then for the Hessian (nh). */
typedef struct {
    void *gradient, *hessian;
    const int32_t *arguments;
    int32_t ng, nh, np;
    const double *parameters;
} stretches_t;

double cell_values(const cells_t *cells, const density_t *density, const double *x);
void cell_gradients(const cells_t *cells, const density_t *density, const double *x, double *out);
void cell_hessians(const cells_t *cells, const density_t *density, const double *x, const int32_t *slots, int mode,
                   double weight, double *out);
void isotropic_hessians(const cells_t *cells, const stretches_t *density, const double *x, const int32_t *slots,
                        int mode, double weight, double *out);
int64_t inverted_cells(const cells_t *cells, const double *x);
double volume_step(const cells_t *cells, const double *x, const double *p, double keep);
int64_t merge_pairs(int d, int64_t rows, int64_t first, int64_t n, const int32_t *cell_starts,
                    const int32_t *cell_columns, const double *cells, int64_t pairs, const int64_t *pair_rows,
                    const int64_t *pair_columns, const double *pair_blocks, const uint8_t *fixed, int32_t *starts,
                    int32_t *columns, double *blocks);
#endif
