/* Prolongations P with scalar weights, the same for every component: products with vectors, and Galerkin products P' A P of blocked matrices. */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))

INLINE int product(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
                   const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t coarse, const int32_t *table,
                   double *out)
{
    const int dd = d * d;
    double *sum = calloc(coarse * dd, sizeof(double));
    int32_t *met = malloc(coarse * sizeof(int32_t));
    char *seen = calloc(coarse, 1);
    if (!sum || !met || !seen) {
        free(sum), free(met), free(seen);
        return 1;
    }
    for (int64_t i = 0; i < rows; ++i) {
        /* sum_j A_ij P_j, then P_i' times it; diagonal blocks count half, since the transpose is added at the end. */
        int64_t count = 0;
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k) {
            const int64_t j = columns[k];
            const double *A = blocks + k * dd, share = j == first + i ? 0.5 : 1.0;
            for (int64_t q = p_starts[j]; q < p_starts[j + 1]; ++q) {
                const int32_t c = p_columns[q];
                const double w = share * p_weights[q];
                double *s = sum + (int64_t)c * dd;
                if (!seen[c])
                    seen[c] = 1, met[count++] = c;
                for (int e = 0; e < dd; ++e)
                    s[e] += w * A[e];
            }
        }
        for (int64_t q = p_starts[first + i]; q < p_starts[first + i + 1]; ++q) {
            const double w = p_weights[q];
            const int32_t *row = table + (int64_t)p_columns[q] * coarse;
            for (int64_t m = 0; m < count; ++m) {
                double *o = out + (int64_t)row[met[m]] * dd;
                const double *s = sum + (int64_t)met[m] * dd;
                for (int e = 0; e < dd; ++e)
                    o[e] += w * s[e];
            }
        }
        for (int64_t m = 0; m < count; ++m) {
            seen[met[m]] = 0;
            memset(sum + (int64_t)met[m] * dd, 0, dd * sizeof(double));
        }
    }
    free(sum), free(met), free(seen);
    return 0;
}

/* Adds to out (d x d blocks) one triangle's worth of P' A P: with its transpose, it is the product with the whole symmetric A.
 *
 * A: `rows` rows from block row `first` on, on or right of the diagonal, CSR with global columns. P: CSR over all fine blocks.
 * table (coarse x coarse): where the block (a, c) is in out. Returns 1 if memory ran out. */
int galerkin(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
             const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t coarse, const int32_t *table, double *out)
{
    return d == 3 ? product(3, rows, first, starts, columns, blocks, p_starts, p_columns, p_weights, coarse, table, out)
                  : product(2, rows, first, starts, columns, blocks, p_starts, p_columns, p_weights, coarse, table, out);
}

INLINE void times_transpose(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights, const double *fine,
                            double *coarse)
{
    for (int64_t i = 0; i < rows; ++i)
        for (int64_t q = starts[i]; q < starts[i + 1]; ++q)
            for (int a = 0; a < d; ++a)
                coarse[(int64_t)columns[q] * d + a] += weights[q] * fine[i * d + a];
}

/* Adds P' fine to coarse. P: `rows` rows, CSR, the starts of which need not be zero. */
void restriction(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights, const double *fine, double *coarse)
{
    if (d == 3)
        times_transpose(3, rows, starts, columns, weights, fine, coarse);
    else
        times_transpose(2, rows, starts, columns, weights, fine, coarse);
}

INLINE void times(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights, const double *coarse, double *fine)
{
    for (int64_t i = 0; i < rows; ++i)
        for (int64_t q = starts[i]; q < starts[i + 1]; ++q)
            for (int a = 0; a < d; ++a)
                fine[i * d + a] += weights[q] * coarse[(int64_t)columns[q] * d + a];
}

/* Adds P coarse to fine. */
void prolongation(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights, const double *coarse, double *fine)
{
    if (d == 3)
        times(3, rows, starts, columns, weights, coarse, fine);
    else
        times(2, rows, starts, columns, weights, coarse, fine);
}
