/* The coarse correction P (P' A P)^-1 P' of a prolongation P with scalar weights, the same for every component. P' A P is kept by rows, each from
 * its first entry to the diagonal (its envelope, which Cholesky's factor has, too); row r begins at begins[r]. */
#include "linear.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

INLINE int64_t length(const int64_t *begins, int64_t row) { return begins[row + 1] - begins[row]; }

/* For each node the first one that a block of A couples it with: firsts (nodes), node numbers at the start, lowered here. */
void coarse_firsts(int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const int32_t *p_starts, const int32_t *p_columns,
                   int32_t *firsts)
{
    for (int64_t i = 0; i < rows; ++i)
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k) {
            const int64_t ends[2] = {first + i, columns[k]};
            if (p_starts[ends[0]] == p_starts[ends[0] + 1] || p_starts[ends[1]] == p_starts[ends[1] + 1])
                continue;
            for (int e = 0; e < 2; ++e) {
                const int32_t lowest = p_columns[p_starts[ends[e]]]; /* columns of a row ascend */
                for (int64_t q = p_starts[ends[1 - e]]; q < p_starts[ends[1 - e] + 1]; ++q)
                    if (firsts[p_columns[q]] > lowest)
                        firsts[p_columns[q]] = lowest;
            }
        }
}

INLINE int galerkin(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
                    const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t nodes, const int64_t *begins, double *out)
{
    const int dd = d * d;
    double *sum = calloc(nodes * dd + 1, sizeof(double));
    int32_t *met = malloc(nodes * sizeof(int32_t) + 1);
    char *seen = calloc(nodes + 1, 1);
    if (!sum || !met || !seen) {
        free(sum), free(met), free(seen);
        return 1;
    }
    for (int64_t i = 0; i < rows; ++i) {
        /* sum_j A_ij P_j, then P_i' times it and the transpose; diagonal blocks therefore count half. */
        int64_t count = 0;
        if (p_starts[first + i] == p_starts[first + i + 1])
            continue;
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k) {
            const int64_t j = columns[k];
            if (j < first) /* the lower rank's */
                continue;
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
            const int64_t row = p_columns[q];
            for (int64_t m = 0; m < count; ++m) {
                const int64_t column = met[m];
                const double *s = sum + column * dd;
                const int64_t upper = row > column ? row : column, lower = row > column ? column : row;
                for (int a = 0; a < d; ++a) {
                    double *o = out + begins[upper * d + a + 1] - 1 - (upper * d + a) + lower * d;
                    for (int b = 0; b < (row == column ? a + 1 : d); ++b)
                        o[b] += w * (row == column ? s[a * d + b] + s[b * d + a] : row > column ? s[a * d + b] : s[b * d + a]);
                }
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

/* Adds P' A P of this rank's rows of A, on or right of the diagonal, to `out`. P: CSR over all vertices. Returns 1 if memory ran out. */
int coarse_operator(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
                    const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t nodes, const int64_t *begins, double *out)
{
    return d == 3 ? galerkin(3, rows, first, starts, columns, blocks, p_starts, p_columns, p_weights, nodes, begins, out)
                  : galerkin(2, rows, first, starts, columns, blocks, p_starts, p_columns, p_weights, nodes, begins, out);
}

INLINE double dot(int64_t n, const double *x, const double *y)
{
    wide sum[4] = {{0}, {0}, {0}, {0}};
    int64_t k = 0;
    for (; k + 16 <= n; k += 16)
        for (int b = 0; b < 4; ++b)
            sum[b] += *(const wide *)(x + k + 4 * b) * *(const wide *)(y + k + 4 * b);
    sum[0] += sum[1] + (sum[2] + sum[3]);
    double total = sum[0][0] + sum[0][1] + sum[0][2] + sum[0][3];
    for (; k < n; ++k)
        total += x[k] * y[k];
    return total;
}

/* Cholesky's factor L in place, its diagonal inverted. Diagonal entries are first multiplied by one plus `shift`. Returns 1 where it fails. */
int coarse_cholesky(int64_t n, const int64_t *begins, double shift, double *L)
{
    for (int64_t i = 0; i < n; ++i) {
        double *row = L + begins[i + 1] - 1 - i; /* row[j] is L_ij */
        const int64_t begin = i + 1 - length(begins, i);
        row[i] *= 1.0 + shift;
        for (int64_t j = begin; j <= i; ++j) {
            const double *other = L + begins[j + 1] - 1 - j;
            const int64_t from = begin > j + 1 - length(begins, j) ? begin : j + 1 - length(begins, j);
            const double value = row[j] - dot(j - from, row + from, other + from);
            if (j == i && !(value > 0.0))
                return 1;
            row[j] = j == i ? 1.0 / sqrt(value) : value * other[j];
        }
    }
    return 0;
}

INLINE void correct(int d, const linear_system *s, const double *residual, double *x, float *z)
{
    const int64_t n = (int64_t)s->nodes * d;
    memset(x, 0, (n + SPARE) * sizeof(double));
    for (int64_t i = 0; i < s->count; ++i) {
        const wide r = *(const wide *)(residual + i * 4);
        for (int64_t q = s->p_starts[i]; q < s->p_starts[i + 1]; ++q)
            *(wide *)(x + s->p_columns[q] * d) += s->p_weights[q] * r; /* zeros behind the d-th */
    }
    sum_over_ranks(s, x, n);
    for (int64_t i = 0; i < n; ++i) {
        const double *end = s->coarse + s->begins[i + 1] - 1;
        const int64_t before = length(s->begins, i) - 1;
        x[i] = (x[i] - dot(before, end - before, x + i - before)) * *end;
    }
    for (int64_t i = n - 1; i >= 0; --i) {
        const double *end = s->coarse + s->begins[i + 1] - 1;
        const int64_t before = length(s->begins, i) - 1;
        x[i] *= *end;
        for (int64_t k = 0; k < before; ++k)
            x[i - before + k] -= x[i] * end[k - before];
    }
    for (int64_t i = 0; i < s->count; ++i) {
        wide sum = {0};
        for (int64_t q = s->p_starts[i]; q < s->p_starts[i + 1]; ++q)
            sum += s->p_weights[q] * *(const wide *)(x + s->p_columns[q] * d);
        for (int a = 0; a < d; ++a)
            z[i * 4 + a] += (float)sum[a];
    }
}

void add_coarse_correction(const linear_system *s, const double *residual, double *x, float *z)
{
    if (s->d == 3)
        correct(3, s, residual, x, z);
    else
        correct(2, s, residual, x, z);
}
