/* The structure and functions of the linear solver that Python uses. C includes this file, and Python reads it (pdvol/compiled.py). */
#ifndef PDVOL_LINEAR_INTERFACE_H
#define PDVOL_LINEAR_INTERFACE_H
#include <stdint.h>

/* What a rank exchanges with others, and MPI's own functions and handles (messages.py): pointers or, with MPICH, ints in their place. */
typedef struct {
    void *comm, *numbers, *sum, *in_place;
    int (*all_reduce)(const void *mine, void *all, int count, void *type, void *op, void *comm);
    int (*all_to_all)(const void *mine, const int *counts, const int *starts, void *type, void *theirs, const int *their_counts,
                      const int *their_starts, void *their_type, void *comm);
    int32_t rows;                                /* own vertices that go to others, rank by rank */
    const int32_t *row;
    const int32_t *counts, *starts;              /* of numbers for each rank, and where they begin */
    const int32_t *their_counts, *their_starts;
    double *sent, *received;                     /* room for d numbers a row, and for each that comes */
} ranks_t;

/* This rank's rows of a symmetric matrix and of its preconditioner; block CSR throughout, d x d blocks by rows. */
typedef struct {
    int32_t d, count;                        /* 2 or 3; owned vertices */
    const int32_t *starts, *columns;         /* between owned vertices: the upper triangle, diagonal first, columns ascending */
    const double *blocks;
    const int32_t *far_starts, *far_columns; /* couplings with other ranks' vertices, numbered from 0 */
    const double *far_blocks;
    int32_t others;                          /* vertices of other ranks in the factor, behind the owned ones */
    const int32_t *others_starts, *others_columns; /* (count + others) rows: couplings with these, and between them, diagonal first */
    const double *others_blocks;
    const float *weights;                    /* of the owned vertices in the factors: 1 over the root of how many factors they are in */
    const ranks_t *overlap;                  /* the exchange of such vertices; NULL on one rank */
    int32_t *factor_starts, *factor_columns; /* of the factor, ordered as the matrix */
    float *factor;                           /* of incomplete_cholesky */
    int32_t nodes;                           /* coarse vertices; 0 for none */
    const int32_t *p_starts, *p_columns;     /* prolongation of the owned vertices */
    const double *p_weights;
    const double *band;                      /* columns (nodes d, width) of the factor L of P' A P = L L', each from the diagonal down */
    int32_t width;                           /* a multiple of four; what is left of a column is zero */
    const ranks_t *ranks;                    /* NULL on one rank */
} linear_system;

int incomplete_cholesky(const linear_system *system, double drop);
/* P' A P of this rank's rows of A, on or right of the diagonal. P: CSR over all vertices. Lists the blocks of nodes i >= j in `sums` under the keys
 * i nodes + j, and returns their number; room for as many as there are such keys. places (nodes, nodes): zeros at first. */
int64_t coarse_operator(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns,
                        const double *blocks, const int32_t *p_starts, const int32_t *p_columns, const double *p_weights,
                        int64_t nodes, int32_t *places, int64_t *keys, double *sums);
void split_rows(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns,
                const double *blocks, int32_t *own_starts, int32_t *own_columns, double *own_blocks,
                int32_t *far_starts, int32_t *far_columns, double *far_blocks);
/* Numbers the vertices of other ranks in far_columns, in place, from 0 and rank by rank, and returns how many there are (-1: no memory left).
 * rows (as many as far blocks at most): for each rank the own vertices that are coupled with its, ascending; is_strong: whether by a block of at least
 * `strong` times the size of the diagonal block there. counts, their_counts (ranks): of `rows`, and of others' vertices. ends (ranks): of the ranks'
 * global numbers. number: -1 for each global number, before and after. */
int64_t border(const linear_system *system, double strong, int32_t ranks, const int64_t *ends, int32_t *number, int32_t *far_columns, int32_t *rows,
               uint8_t *is_strong, int32_t *counts, int32_t *their_counts);
/* What the other ranks' factors get of this one. For each rank numbers has the lengths of its rows, zero where a row is not strong, and columns
 * numbered within the strong ones; blocks the blocks between these, on or right of the diagonal. shared: the strong rows; weights (count) as in
 * linear_system. number: -1 for each own vertex, before and after. */
void pack_overlap(const linear_system *system, int32_t ranks, const int32_t *counts, const int32_t *rows, const uint8_t *is_strong, int32_t *number,
                  int32_t *numbers, double *blocks, int32_t *block_counts, int32_t *shared, int32_t *shared_counts, float *weights);
/* What came of others' pack_overlap as the others_* of linear_system, with room for all far blocks and those that came; shared_counts (ranks): of vertices
 * in the factor. Returns 1 if memory ran out. */
int unpack_overlap(const linear_system *system, int32_t ranks, const int32_t *counts, const int32_t *block_counts, const int32_t *numbers,
                   const double *blocks, int32_t *shared_counts, int32_t *others_starts, int32_t *others_columns, double *others_blocks);
int symmetric_product(const linear_system *system, const double *x, double *y);
int conjugate_gradients(const linear_system *system, const double *right, const double *start, double tolerance,
                        int32_t most, double *solution, int32_t *iterations);
/* z (count + others, 4) = (R' R)^-1 z. */
void precondition_locally(const linear_system *system, float *z);
/* Adds P (P' A P)^-1 P' residual (count, 4) to z (count, 4); x: room for nodes d + width numbers. */
void add_coarse_correction(const linear_system *system, const double *residual, double *x, float *z);
#endif
