/* Incomplete Cholesky factor A ~ R' R by blocks, without fill, in single precision: R' R is positive semi-definite however R is rounded. */
#include "linear.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Where a pivot is not positive definite, diagonal blocks are multiplied by one plus a shift (Manteuffel 1980). */
#define FIRST_SHIFT 0.15 /* share of the diagonal, tried first: stiff contacts need 0.1 to 0.2, twice as much costs a fifth more iterations */
#define SHIFT_RATIO 2.0  /* ratio of consecutive shifts: a failed try costs two or three iterations */

/* inverse (d, d) of the upper triangular R with R' R = A (rows of four numbers). Returns 1 where A is not positive definite. */
INLINE int invert_root(int d, const float *A, float *inverse)
{
    float R[9] = {0};
    for (int a = 0; a < d; ++a) {
        for (int b = a; b < d; ++b) {
            float value = A[a * 4 + b];
            for (int c = 0; c < a; ++c)
                value -= R[c * d + a] * R[c * d + b];
            if (a == b && !(value > 0.0f))
                return 1;
            R[a * d + b] = a == b ? sqrtf(value) : value / R[a * d + a];
        }
    }
    memset(inverse, 0, d * d * sizeof(float));
    for (int b = 0; b < d; ++b) {
        inverse[b * d + b] = 1.0f / R[b * d + b];
        for (int a = b - 1; a >= 0; --a) {
            float value = 0.0f;
            for (int c = a + 1; c <= b; ++c)
                value -= R[a * d + c] * inverse[c * d + b];
            inverse[a * d + b] = value / R[a * d + a];
        }
    }
    return 0;
}

/* Rows of a block CSR: those of a rank's own vertices, and what comes to them and behind them by vertices of other ranks. */
typedef struct {
    int64_t count;
    const int32_t *starts, *columns;
    const double *blocks;
} rows_t;

/* One row after the other is gathered from both `parts` in `row`, blocks of d rows of four numbers; `place` has the row's block in each column. Done
 * rows wait in the list of the column that they change next. Returns the first row whose pivot fails, or n. */
INLINE int64_t try_shift(int d, int64_t n, const rows_t *parts, const double *least, float shift, int32_t *r_starts, int32_t *r_columns, float *R,
                         float *row, int32_t *place, int32_t *next, int32_t *first, int32_t *at)
{
    const int dd = d * d, s = 4 * d;
    int64_t end = 0;
    for (int64_t i = 0; i < n; ++i)
        place[i] = first[i] = -1;
    for (int64_t i = 0; i < n; ++i) {
        const int64_t begin = end;
        for (const rows_t *part = parts; part < parts + 2; ++part)
            for (int64_t k = i < part->count ? part->starts[i] : 0; k < (i < part->count ? part->starts[i + 1] : 0); ++k) {
                const double *block = part->blocks + k * dd;
                const int64_t j = part->columns[k];
                if (least && end > begin && squares(dd, block) < least[i] * least[j])
                    continue;
                for (int a = 0; a < d; ++a)
                    *(narrow *)(row + (end - begin) * s + a * 4) = __builtin_convertvector(*(const wide *)(block + a * d), narrow);
                place[j] = end, r_columns[end++] = j;
            }
        r_starts[i] = begin, r_starts[i + 1] = end;
        for (int a = 0; a < d; ++a)
            *(narrow *)(row + a * 4) *= 1.0f + shift;
        for (int32_t before = first[i], then; before >= 0; before = then) {
            const int64_t own = at[before], last = r_starts[before + 1];
            const float *left = R + own * dd;
            then = next[before];
            for (int64_t k = own; k < last; ++k) {
                const int64_t to = place[r_columns[k]] - begin;
                if (to < 0)
                    continue;
                for (int a = 0; a < d; ++a) {
                    narrow sum = *(narrow *)(row + to * s + a * 4);
                    for (int b = 0; b < d; ++b)
                        sum -= left[b * d + a] * *(const narrow *)(R + k * dd + b * d);
                    *(narrow *)(row + to * s + a * 4) = sum;
                }
            }
            if (own + 1 < last) {
                at[before] = own + 1;
                next[before] = first[r_columns[own + 1]];
                first[r_columns[own + 1]] = before;
            }
        }
        float *root = R + begin * dd;
        if (invert_root(d, row, root))
            return i;
        for (int64_t k = begin + 1; k < end; ++k)
            for (int a = 0; a < d; ++a) {
                narrow sum = root[a] * *(const narrow *)(row + (k - begin) * s);
                for (int b = 1; b <= a; ++b)
                    sum += root[b * d + a] * *(const narrow *)(row + (k - begin) * s + b * 4);
                *(narrow *)(R + k * dd + a * d) = sum;
            }
        if (begin + 1 < end) {
            at[i] = begin + 1;
            next[i] = first[r_columns[begin + 1]];
            first[r_columns[begin + 1]] = i;
        }
    }
    return n;
}

/* Whether a d x d block is not positive definite, so that no shift helps. */
INLINE int is_indefinite(int d, const double *block)
{
    float A[12] = {0}, inverse[9];
    for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b)
            A[a * 4 + b] = block[a * d + b];
    return invert_root(d, A, inverse);
}

/* The block on the diagonal at vertex i of the factor. */
INLINE const double *diagonal(int d, const linear_system *s, int64_t i)
{
    return i < s->count ? s->blocks + (int64_t)s->starts[i] * d * d : s->others_blocks + (int64_t)s->others_starts[i] * d * d;
}

INLINE int factor(int d, const linear_system *s, double drop)
{
    const rows_t parts[2] = {{s->count, s->starts, s->columns, s->blocks},
                             {s->others_starts ? s->count + s->others : 0, s->others_starts, s->others_columns, s->others_blocks}};
    const int64_t n = s->count + s->others;
    int64_t longest = 0;
    for (int64_t i = 0; i < n; ++i) {
        int64_t length = 0;
        for (int p = 0; p < 2; ++p)
            length += i < parts[p].count ? parts[p].starts[i + 1] - parts[p].starts[i] : 0;
        longest = length > longest ? length : longest;
    }
    float *row = malloc(longest * 4 * d * sizeof(float) + 1);
    int32_t *lists = malloc(4 * n * sizeof(int32_t) + 1);
    double *least = drop > 0.0 ? malloc(n * sizeof(double) + 1) : 0;
    int tries = 0;
    for (int64_t i = 0; least && i < n; ++i)
        least[i] = drop * sqrt(squares(d * d, diagonal(d, s, i)));
    for (float shift = 0.0f; row && lists && (least || !(drop > 0.0)); shift = shift > 0.0f ? SHIFT_RATIO * shift : FIRST_SHIFT) {
        ++tries;
        const int64_t failed = try_shift(d, n, parts, least, shift, s->factor_starts, s->factor_columns, s->factor, row, lists, lists + n,
                                         lists + 2 * n, lists + 3 * n);
        if (failed == n)
            break;
        if (is_indefinite(d, diagonal(d, s, failed)) || isinf(shift)) {
            tries = -1;
            break;
        }
    }
    free(row), free(lists), free(least);
    return tries;
}

/* R of A without the blocks beside the diagonal with |A_ij|^2 < drop^2 |A_ii| |A_jj|, in the system's factor_starts, factor_columns (room for as many
 * blocks as A has) and factor. Diagonal blocks are inverted. Returns the number of tries, -1 where a diagonal block of A is not positive definite,
 * and 0 where memory ran out. */
int incomplete_cholesky(const linear_system *s, double drop) { return s->d == 3 ? factor(3, s, drop) : factor(2, s, drop); }

INLINE void solve(int d, int64_t n, const int32_t *starts, const int32_t *columns, const float *R, float *v)
{
    const int dd = d * d;
    for (int64_t i = 0; i < n; ++i) { /* R' y = v */
        const float *root = R + (int64_t)starts[i] * dd;
        float y[3];
        for (int a = 0; a < d; ++a) {
            y[a] = root[a] * v[i * 4];
            for (int b = 1; b <= a; ++b)
                y[a] += root[b * d + a] * v[i * 4 + b];
        }
        for (int a = 0; a < d; ++a)
            v[i * 4 + a] = y[a];
        for (int64_t k = starts[i] + 1; k < starts[i + 1]; ++k) {
            narrow *to = (narrow *)(v + (int64_t)columns[k] * 4);
            narrow sum = *to;
            for (int a = 0; a < d; ++a)
                sum -= y[a] * *(const narrow *)(R + k * dd + a * d);
            *to = sum;
        }
    }
    for (int64_t i = n - 1; i >= 0; --i) { /* R z = y */
        const float *root = R + (int64_t)starts[i] * dd;
        narrow sum[3] = {{0}, {0}, {0}};
        for (int64_t k = starts[i] + 1; k < starts[i + 1]; ++k) {
            const narrow z = *(const narrow *)(v + (int64_t)columns[k] * 4);
            for (int a = 0; a < d; ++a)
                sum[a] += z * *(const narrow *)(R + k * dd + a * d);
        }
        float y[3];
        for (int a = 0; a < d; ++a)
            y[a] = v[i * 4 + a] - (sum[a][0] + sum[a][1] + (d == 3 ? sum[a][2] : 0.0f));
        for (int a = 0; a < 4; ++a) {
            float z = 0.0f;
            for (int b = a; b < d; ++b)
                z += root[a * d + b] * y[b];
            v[i * 4 + a] = z;
        }
    }
}

void precondition_locally(const linear_system *s, float *z)
{
    const int64_t n = s->count + s->others;
    if (s->d == 3)
        solve(3, n, s->factor_starts, s->factor_columns, s->factor, z);
    else
        solve(2, n, s->factor_starts, s->factor_columns, s->factor, z);
}
