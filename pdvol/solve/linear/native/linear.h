/* Vectors inside the loop have four numbers a vertex, of which those behind the d-th are zero: rows of d x d blocks are then read as four
 * numbers, too, and what follows a row is multiplied by zero or never read. Arrays of blocks therefore have SPARE finite numbers at their end. */
#ifndef PDVOL_LINEAR_H
#define PDVOL_LINEAR_H
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))
#define SPARE 4
typedef double wide __attribute__((vector_size(32), aligned(8), may_alias));
typedef float narrow __attribute__((vector_size(16), aligned(4), may_alias));

/* This rank's rows of a symmetric matrix and of its preconditioner; block CSR throughout, d x d blocks by rows. */
typedef struct {
    int32_t d, count;                        /* 2 or 3; owned vertices */
    const int32_t *starts, *columns;         /* between owned vertices: the upper triangle, diagonal first, columns ascending */
    const double *blocks;
    const int32_t *far_starts, *far_columns; /* couplings with other ranks' vertices, numbered from 0 */
    const double *far_blocks;
    const float *factor;                     /* of incomplete_cholesky */
    int32_t nodes;                           /* coarse vertices; 0 for none */
    const int32_t *p_starts, *p_columns;     /* prolongation of the owned vertices */
    const double *p_weights;
    const int64_t *begins;                   /* of coarse_cholesky */
    const double *coarse;
    void (*exchange)(const double *own, double *far); /* other ranks' values (.., d) of a vector; NULL on one rank */
    void (*sum)(double *numbers, int32_t count);      /* over all ranks, in place; NULL on one rank */
} linear_system;

/* z (count, 4) = (R' R)^-1 z. */
void precondition_locally(const linear_system *system, float *z);
/* Adds P (P' A P)^-1 P' residual (count, 4) to z (count, 4); x: room for nodes d + SPARE numbers. */
void add_coarse_correction(const linear_system *system, const double *residual, double *x, float *z);
#endif
