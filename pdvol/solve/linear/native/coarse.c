/* The coarse correction P (P' A P)^-1 P' of a prolongation P with scalar weights, the same for every component. The pattern of P' A P changes with
 * the contacts: it is listed by blocks, and the order of elimination is found for each matrix anew. */
#include "linear.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

INLINE int64_t galerkin(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
                        const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t nodes, int64_t room, int64_t *keys, double *sums)
{
    const int dd = d * d;
    int64_t known = 0;
    double *sum = calloc(nodes * dd + 1, sizeof(double));
    int32_t *met = malloc(nodes * sizeof(int32_t) + 1), *places = calloc(nodes * (nodes + 1) / 2 + 1, sizeof(int32_t)); /* in the list, plus 1; 0 for none */
    char *seen = calloc(nodes + 1, 1);
    if (!sum || !met || !places || !seen)
        known = -2;
    for (int64_t i = 0; i < rows && known >= 0; ++i) {
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
        for (int64_t q = p_starts[first + i]; q < p_starts[first + i + 1] && known >= 0; ++q) {
            const double w = p_weights[q];
            const int64_t row = p_columns[q];
            for (int64_t m = 0; m < count; ++m) {
                const int64_t column = met[m], upper = row > column ? row : column, lower = row > column ? column : row;
                const double *s = sum + column * dd;
                int32_t *place = places + upper * (upper + 1) / 2 + lower;
                if (!*place) {
                    if (known == room) {
                        known = -1;
                        break;
                    }
                    memset(sums + known * dd, 0, dd * sizeof(double));
                    keys[known++] = upper * nodes + lower, *place = (int32_t)known;
                }
                double *o = sums + (int64_t)(*place - 1) * dd;
                for (int a = 0; a < d; ++a)
                    for (int b = 0; b < d; ++b)
                        o[a * d + b] += w * (row > column ? s[a * d + b] : row < column ? s[b * d + a] : s[a * d + b] + s[b * d + a]);
            }
        }
        for (int64_t m = 0; m < count; ++m) {
            seen[met[m]] = 0;
            memset(sum + (int64_t)met[m] * dd, 0, dd * sizeof(double));
        }
    }
    free(sum), free(met), free(places), free(seen);
    return known;
}

/* P' A P of this rank's rows of A, on or right of the diagonal. P: CSR over all vertices. Lists the blocks (room, d, d) of nodes i >= j under the keys
 * i nodes + j (room). Returns their number, -1 where there are more than `room`, and -2 if memory ran out. */
int64_t coarse_operator(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
                        const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t nodes, int64_t room, int64_t *keys, double *sums)
{
    return d == 3 ? galerkin(3, rows, first, starts, columns, blocks, p_starts, p_columns, p_weights, nodes, room, keys, sums)
                  : galerkin(2, rows, first, starts, columns, blocks, p_starts, p_columns, p_weights, nodes, room, keys, sums);
}

/* The order of elimination of the matrix whose blocks have these keys: of minimum degree (Tinney and Walker 1967), with a node's neighbours as bits.
 * order (nodes): the place of each. parent (nodes): of each column of the factor L the row of the first block below its diagonal, -1 for none.
 * l_starts (nodes + 1): where the columns of L begin. Returns the number of blocks of L below its diagonal, -2 if memory ran out. */
int64_t coarse_order(int64_t nodes, int64_t count, const int64_t *keys, int32_t *order, int32_t *parent, int32_t *l_starts)
{
    const int64_t words = (nodes + 63) / 64;
    uint64_t *near = calloc(nodes * words + 1, sizeof(uint64_t));
    int32_t *degrees = calloc(nodes + 1, sizeof(int32_t));
    if (!near || !degrees) {
        free(near), free(degrees);
        return -2;
    }
    for (int64_t k = 0; k < count; ++k) {
        const int64_t i = keys[k] / nodes, j = keys[k] % nodes;
        if (i != j) {
            near[i * words + j / 64] |= (uint64_t)1 << j % 64, near[j * words + i / 64] |= (uint64_t)1 << i % 64;
            ++degrees[i], ++degrees[j];
        }
    }
    l_starts[0] = 0;
    for (int64_t k = 0; k < nodes; ++k) {
        int64_t pivot = 0;
        for (int64_t i = 1; i < nodes; ++i)
            if (degrees[i] < degrees[pivot])
                pivot = i;
        const uint64_t *own = near + pivot * words;
        l_starts[k + 1] = l_starts[k] + degrees[pivot], degrees[pivot] = INT32_MAX, order[pivot] = k;
        for (int64_t w = 0; w < words; ++w)
            for (uint64_t rest = own[w]; rest; rest &= rest - 1) { /* its neighbours become one another's */
                const int64_t i = w * 64 + __builtin_ctzll(rest);
                uint64_t *its = near + i * words;
                int32_t degree = 0;
                for (int64_t v = 0; v < words; ++v)
                    its[v] |= own[v];
                its[i / 64] &= ~((uint64_t)1 << i % 64), its[pivot / 64] &= ~((uint64_t)1 << pivot % 64);
                for (int64_t v = 0; v < words; ++v)
                    degree += __builtin_popcountll(its[v]);
                degrees[i] = degree;
            }
    }
    for (int64_t i = 0; i < nodes; ++i) {
        int32_t least = INT32_MAX;
        for (int64_t w = 0; w < words; ++w)
            for (uint64_t rest = near[i * words + w]; rest; rest &= rest - 1) {
                const int32_t place = order[w * 64 + __builtin_ctzll(rest)];
                least = place < least ? place : least;
            }
        parent[order[i]] = least == INT32_MAX ? -1 : least;
    }
    free(near), free(degrees);
    return l_starts[nodes];
}

/* The inverse of a symmetric d x d block. Returns 1 unless it is positive definite. */
INLINE int invert(int d, const double *A, double *inverse)
{
    double L[9], M[9] = {0};
    for (int a = 0; a < d; ++a)
        for (int b = 0; b <= a; ++b) {
            double value = A[a * d + b];
            for (int c = 0; c < b; ++c)
                value -= L[a * d + c] * L[b * d + c];
            if (a == b && !(value > 0.0))
                return 1;
            L[a * d + b] = a == b ? sqrt(value) : value / L[b * d + b];
        }
    for (int b = 0; b < d; ++b) { /* M = L^-1 */
        M[b * d + b] = 1.0 / L[b * d + b];
        for (int a = b + 1; a < d; ++a) {
            double value = 0.0;
            for (int c = b; c < a; ++c)
                value -= L[a * d + c] * M[c * d + b];
            M[a * d + b] = value / L[a * d + a];
        }
    }
    for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b) {
            double value = 0.0;
            for (int c = a > b ? a : b; c < d; ++c)
                value += M[c * d + a] * M[c * d + b];
            inverse[a * d + b] = value;
        }
    return 0;
}

INLINE int factor(int d, int64_t n, int64_t count, const int64_t *keys, const double *blocks, double shift, const int32_t *order, const int32_t *parent,
                  const int32_t *l_starts, int32_t *l_rows, double *l_blocks, double *pivots)
{
    const int dd = d * d;
    double *row = calloc(n * 4 * d + 1, sizeof(double)); /* of A, then of L D: d x 4 numbers a block */
    int32_t *ends = calloc(4 * n + 1 + 2 * count, sizeof(int32_t)), *flag = ends + n, *pattern = flag + n, *starts = pattern + n;
    int32_t *columns = starts + n + 1, *from = columns + count; /* of A in the new order: up to the diagonal, by rows */
    int failed = !row || !ends ? -1 : 0;
    for (int64_t e = 0; e < 2 * count && !failed; ++e) { /* counts, then lists */
        const int64_t key = keys[e % count];
        const int32_t i = order[key / n], j = order[key % n], high = i > j ? i : j;
        if (e == count)
            for (int64_t k = 0; k < n; ++k)
                starts[k + 1] += starts[k];
        if (e < count)
            ++starts[high + 1];
        else {
            const int32_t at = starts[high] + ends[high]++;
            columns[at] = i < j ? i : j, from[at] = (int32_t)(e - count);
        }
    }
    for (int64_t k = 0; k < n && !failed; ++k) {
        int64_t top = n; /* pattern[top..n): columns of the row's blocks in L, in an order that the tree allows */
        ends[k] = l_starts[k], flag[k] = k;
        for (int64_t p = starts[k]; p < starts[k + 1]; ++p) {
            const double *A = blocks + (int64_t)from[p] * dd;
            double *to = row + (int64_t)columns[p] * 4 * d;
            const int turned = order[keys[from[p]] / n] != k;
            int64_t length = 0;
            for (int a = 0; a < d; ++a)
                for (int b = 0; b < d; ++b)
                    to[a * 4 + b] = turned ? A[b * d + a] : A[a * d + b];
            for (int32_t i = columns[p]; flag[i] != k; i = parent[i])
                pattern[length++] = i, flag[i] = k;
            while (length > 0)
                pattern[--top] = pattern[--length];
        }
        double *own = row + k * 4 * d, pivot[9];
        for (int a = 0; a < d; ++a)
            own[a * 4 + a] *= 1.0 + shift;
        for (; top < n; ++top) {
            const int64_t i = pattern[top], last = ends[i]++;
            double Y[12];
            memcpy(Y, row + i * 4 * d, 4 * d * sizeof(double));
            memset(row + i * 4 * d, 0, 4 * d * sizeof(double));
            for (int64_t p = l_starts[i]; p < last; ++p) {
                double *to = row + (int64_t)l_rows[p] * 4 * d;
                const double *B = l_blocks + p * dd; /* blocks of L are kept transposed */
                for (int a = 0; a < d; ++a) {
                    wide sum = *(wide *)(to + a * 4);
                    for (int c = 0; c < d; ++c)
                        sum -= Y[a * 4 + c] * *(const wide *)(B + c * d);
                    *(wide *)(to + a * 4) = sum;
                }
            }
            l_rows[last] = k;
            for (int b = 0; b < d; ++b)
                for (int a = 0; a < d; ++a) {
                    double value = 0.0;
                    for (int c = 0; c < d; ++c)
                        value += Y[a * 4 + c] * pivots[i * dd + c * d + b];
                    l_blocks[last * dd + b * d + a] = value;
                }
            for (int a = 0; a < d; ++a)
                for (int b = 0; b < d; ++b)
                    for (int c = 0; c < d; ++c)
                        own[a * 4 + b] -= l_blocks[last * dd + c * d + a] * Y[b * 4 + c];
        }
        for (int a = 0; a < d; ++a)
            memcpy(pivot + a * d, own + a * 4, d * sizeof(double));
        failed = invert(d, pivot, pivots + k * dd);
        memset(own, 0, 4 * d * sizeof(double));
    }
    free(row), free(ends);
    return failed;
}

/* L (transposed blocks, by columns) and the inverse of D in A = L D L', without pivoting, of the matrix with these blocks, its diagonal grown by the
 * share `shift`, where `order`, `parent` and `l_starts` are those of coarse_order. Returns 1 unless it is positive definite, -1 if memory ran out. */
int coarse_factor(int d, int64_t n, int64_t count, const int64_t *keys, const double *blocks, double shift, const int32_t *order, const int32_t *parent,
                  const int32_t *l_starts, int32_t *l_rows, double *l_blocks, double *pivots)
{
    return d == 3 ? factor(3, n, count, keys, blocks, shift, order, parent, l_starts, l_rows, l_blocks, pivots)
                  : factor(2, n, count, keys, blocks, shift, order, parent, l_starts, l_rows, l_blocks, pivots);
}

/* x = (L D L')^-1 x; y: room for four numbers a node. */
INLINE void solve_coarse(int d, const linear_system *s, double *x, double *y)
{
    const int dd = d * d;
    for (int64_t i = 0; i < s->nodes; ++i)
        memcpy(y + (int64_t)s->order[i] * 4, x + i * d, d * sizeof(double));
    for (int64_t j = 0; j < s->nodes; ++j) {
        const double *own = y + j * 4;
        for (int64_t k = s->l_starts[j]; k < s->l_starts[j + 1]; ++k) {
            const double *B = s->l_blocks + k * dd;
            wide to = *(wide *)(y + (int64_t)s->l_rows[k] * 4);
            for (int c = 0; c < d; ++c)
                to -= *(const wide *)(B + c * d) * own[c];
            *(wide *)(y + (int64_t)s->l_rows[k] * 4) = to;
        }
    }
    for (int64_t j = (int64_t)s->nodes - 1; j >= 0; --j) {
        wide own = {0}, sum[3] = {{0}};
        for (int b = 0; b < d; ++b)
            own += *(const wide *)(s->pivots + j * dd + b * d) * y[j * 4 + b];
        for (int64_t k = s->l_starts[j]; k < s->l_starts[j + 1]; ++k) {
            const wide from = *(const wide *)(y + (int64_t)s->l_rows[k] * 4);
            for (int c = 0; c < d; ++c)
                sum[c] += *(const wide *)(s->l_blocks + k * dd + c * d) * from;
        }
        for (int c = 0; c < d; ++c)
            own[c] -= d == 3 ? sum[c][0] + sum[c][1] + sum[c][2] : sum[c][0] + sum[c][1];
        *(wide *)(y + j * 4) = own;
    }
    for (int64_t i = 0; i < s->nodes; ++i)
        memcpy(x + i * d, y + (int64_t)s->order[i] * 4, d * sizeof(double));
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
    solve_coarse(d, s, x, x + n + SPARE);
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
