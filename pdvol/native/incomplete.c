/* Incomplete Cholesky factor A ~ R' R by blocks, without fill, in single precision: R' R is positive semi-definite however R is rounded. */
#include "linear.h"

/* Where a pivot is not positive definite, diagonal blocks are multiplied by one plus a shift (Manteuffel 1980). */
#define FIRST_SHIFT 0.15 /* share of the diagonal, tried first: stiff contacts need 0.1 to 0.2, twice as much costs a fifth more iterations */
#define SHIFT_RATIO 2.0  /* ratio of consecutive shifts: a failed try costs two or three iterations */

/* inverse (d, d) of the upper triangular R with R' R = A (rows of four numbers). Returns 1 where A is not positive definite. */
INLINE int invert_root(const float *A, float *inverse)
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

/* How many blocks row i has in `own` (part 0) and in `between` (part 1). */
INLINE int64_t length(const linear_system *s, int part, int64_t i)
{
    const int32_t *starts = part ? s->between.starts : s->own.starts;
    return starts && (part || i < s->count) ? starts[i + 1] - starts[i] : 0;
}

/* One row after the other is gathered in `row` from `own` and `between`, blocks of d rows of four numbers; `place` has the row's block in each column.
 * Done rows wait in the list of the column that they change next. Returns the first row whose pivot fails, or n. */
INLINE int64_t try_shift(const linear_system *s, const double *least, float shift, float *row, int32_t *place)
{
    const int64_t n = s->count + s->others;
    int32_t *r_starts = s->factor_starts, *r_columns = s->factor_columns, *next = place + n, *first = next + n, *at = first + n;
    float *R = s->factor;
    int64_t end = 0;
    for (int64_t i = 0; i < n; ++i)
        place[i] = first[i] = -1;
    for (int64_t i = 0; i < n; ++i) {
        const int64_t begin = end;
        for (int p = 0; p < 2; ++p)
            for (int64_t k = 0, count = length(s, p, i); k < count; ++k) {
                const rows_t *part = p ? &s->between : &s->own;
                const double *block = part->blocks + (part->starts[i] + k) * dd;
                const int64_t j = part->columns[part->starts[i] + k];
                if (least && end > begin && squares(dd, block) < least[i] * least[j])
                    continue;
                for (int a = 0; a < d; ++a)
                    *(narrow *)(row + (end - begin) * 4 * d + a * 4) = __builtin_convertvector(*(const wide *)(block + a * d), narrow);
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
                    narrow sum = *(narrow *)(row + to * 4 * d + a * 4);
                    for (int b = 0; b < d; ++b)
                        sum -= left[b * d + a] * *(const narrow *)(R + k * dd + b * d);
                    *(narrow *)(row + to * 4 * d + a * 4) = sum;
                }
            }
            if (own + 1 < last) {
                at[before] = own + 1;
                next[before] = first[r_columns[own + 1]];
                first[r_columns[own + 1]] = before;
            }
        }
        float *root = R + begin * dd;
        if (invert_root(row, root))
            return i;
        for (int64_t k = begin + 1; k < end; ++k)
            for (int a = 0; a < d; ++a) {
                narrow sum = root[a] * *(const narrow *)(row + (k - begin) * 4 * d);
                for (int b = 1; b <= a; ++b)
                    sum += root[b * d + a] * *(const narrow *)(row + (k - begin) * 4 * d + b * 4);
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
INLINE int is_indefinite(const double *block)
{
    float A[12] = {0}, inverse[9];
    for (int a = 0; a < d; ++a)
        for (int b = 0; b < d; ++b)
            A[a * 4 + b] = block[a * d + b];
    return invert_root(A, inverse);
}

/* The block on the diagonal at vertex i of the factor. */
INLINE const double *diagonal(const linear_system *s, int64_t i)
{
    return i < s->count ? s->own.blocks + (int64_t)s->own.starts[i] * dd : s->between.blocks + (int64_t)s->between.starts[i] * dd;
}

/* R of A without the blocks beside the diagonal with |A_ij|^2 < drop^2 |A_ii| |A_jj|, in the system's factor_starts, factor_columns (room for as many
 * blocks as A has) and factor. Diagonal blocks are inverted. Returns the number of tries, -1 where a diagonal block of A is not positive definite,
 * and 0 where memory ran out. */
int incomplete_cholesky(const linear_system *s, double drop)
{
    const int64_t n = s->count + s->others;
    int64_t longest = 0;
    for (int64_t i = 0; i < n; ++i) {
        const int64_t both = length(s, 0, i) + length(s, 1, i);
        longest = both > longest ? both : longest;
    }
    float *row = malloc(longest * 4 * d * sizeof(float) + 1);
    int32_t *lists = malloc(4 * n * sizeof(int32_t) + 1);
    double *least = drop > 0.0 ? malloc(n * sizeof(double) + 1) : 0;
    int tries = 0;
    for (int64_t i = 0; least && i < n; ++i)
        least[i] = drop * sqrt(squares(dd, diagonal(s, i)));
    for (float shift = 0.0f; row && lists && (least || !(drop > 0.0)); shift = shift > 0.0f ? SHIFT_RATIO * shift : FIRST_SHIFT) {
        ++tries;
        const int64_t failed = try_shift(s, least, shift, row, lists);
        if (failed == n)
            break;
        if (is_indefinite(diagonal(s, failed)) || isinf(shift)) {
            tries = -1;
            break;
        }
    }
    free(row), free(lists), free(least);
    return tries;
}

void precondition_locally(const linear_system *s, float *v)
{
    const int64_t n = s->count + s->others;
    const int32_t *starts = s->factor_starts, *columns = s->factor_columns;
    const float *R = s->factor;
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
