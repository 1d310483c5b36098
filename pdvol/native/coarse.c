/* The coarse correction P (P' A P)^-1 P' of a prolongation P with scalar weights, the same for every component. */
#include "linear.h"

int64_t coarse_operator(int64_t rows, int64_t first, const rows_t *A, const int32_t *p_starts, const int32_t *p_columns, const double *p_weights,
                        int64_t nodes, int32_t *places, int64_t *keys, double *sums)
{
    int64_t known = 0;
    for (int64_t i = first; i < first + rows; ++i)
        for (int64_t k = A->starts[i - first]; k < A->starts[i - first + 1]; ++k) {
            const int64_t j = A->columns[k];
            if (j < first) /* the lower rank's */
                continue;
            for (int64_t q = p_starts[i]; q < p_starts[i + 1]; ++q)
                for (int64_t r = p_starts[j]; r < p_starts[j + 1]; ++r) {
                    const double *block = A->blocks + k * dd, w = (i == j ? 0.5 : 1.0) * p_weights[q] * p_weights[r];
                    const int64_t row = p_columns[q], column = p_columns[r];
                    const int64_t key = row < column ? column * nodes + row : row * nodes + column;
                    if (!places[key]) {
                        memset(sums + known * dd, 0, dd * sizeof(double));
                        keys[known++] = key, places[key] = (int32_t)known;
                    }
                    double *sum = sums + (int64_t)(places[key] - 1) * dd;
                    if (row < column)
                        for (int a = 0; a < d; ++a)
                            for (int b = 0; b < d; ++b)
                                sum[a * d + b] += w * block[b * d + a];
                    else
                        for (int e = 0; e < dd; ++e)
                            sum[e] += w * block[e];
                }
        }
    return known;
}

/* x = (L L')^-1 x; zeros follow x (n) and each column of the band. */
static void solve_coarse(int64_t n, int64_t width, const double *band, double *x)
{
    for (int64_t j = 0; j < n; ++j) {
        const double *L = band + j * width, y = x[j] / L[0];
        for (int64_t k = 0; k < width; k += 4)
            *(wide *)(x + j + k) -= y * *(const wide *)(L + k);
        x[j] = y;
    }
    for (int64_t j = n - 1; j >= 0; --j) {
        const double *L = band + j * width, y = x[j];
        wide sum = {0};
        x[j] = 0.0;
        for (int64_t k = 0; k < width; k += 4)
            sum += *(const wide *)(L + k) * *(const wide *)(x + j + k);
        x[j] = (y - (sum[0] + sum[1] + sum[2] + sum[3])) / L[0];
    }
}

void add_coarse_correction(const linear_system *s, const double *residual, double *x, float *z)
{
    const int64_t n = (int64_t)s->nodes * d;
    memset(x, 0, (n + s->width) * sizeof(double));
    for (int64_t i = 0; i < s->count; ++i) {
        const wide r = *(const wide *)(residual + i * 4);
        for (int64_t q = s->p_starts[i]; q < s->p_starts[i + 1]; ++q)
            *(wide *)(x + s->p_columns[q] * d) += s->p_weights[q] * r; /* zeros behind the d-th */
    }
    sum_over_ranks(s, x, n);
    solve_coarse(n, s->width, s->band, x);
    for (int64_t i = 0; i < s->count; ++i) {
        wide sum = {0};
        for (int64_t q = s->p_starts[i]; q < s->p_starts[i + 1]; ++q)
            sum += s->p_weights[q] * *(const wide *)(x + s->p_columns[q] * d);
        for (int a = 0; a < d; ++a)
            z[i * 4 + a] += (float)sum[a];
    }
}
