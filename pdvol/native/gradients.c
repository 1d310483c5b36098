/* Products with a symmetric matrix in blocks and conjugate gradients (Hestenes and Stiefel 1952). */
#include "linear.h"

INLINE double across(wide v) { return d == 3 ? v[0] + v[1] + v[2] : v[0] + v[1]; }

/* y = A x; returns x' y of these rows. */
INLINE double product(const linear_system *s, const double *x, double *y)
{
    const double *far = s->ranks ? s->ranks->received : 0;
    double total = 0.0;
    memset(y, 0, (size_t)s->count * 4 * sizeof(double));
    for (int64_t i = 0; i < s->count; ++i) {
        const wide own = *(const wide *)(x + i * 4);
        int64_t k = s->own.starts[i];
        const double *A = s->own.blocks + k * dd;
        wide sum[3];
        for (int a = 0; a < d; ++a)
            sum[a] = own * *(const wide *)(A + a * d);
        for (++k; k < s->own.starts[i + 1]; ++k) {
            const int64_t j = s->own.columns[k];
            const wide other = *(const wide *)(x + j * 4);
            wide to = *(wide *)(y + j * 4);
            A = s->own.blocks + k * dd;
            for (int a = 0; a < d; ++a) {
                const wide row = *(const wide *)(A + a * d);
                sum[a] += row * other;
                to += row * own[a];
            }
            *(wide *)(y + j * 4) = to;
        }
        for (k = far ? s->far.starts[i] : 0; k < (far ? s->far.starts[i + 1] : 0); ++k)
            for (int a = 0; a < d; ++a)
                for (int b = 0; b < d; ++b)
                    sum[a][0] += s->far.blocks[k * dd + a * d + b] * far[(int64_t)s->far.columns[k] * d + b];
        for (int a = 0; a < d; ++a) {
            y[i * 4 + a] += across(sum[a]);
            total += own[a] * y[i * 4 + a];
        }
        for (int a = d; a < 4; ++a)
            y[i * 4 + a] = 0.0;
    }
    return total;
}

void sum_over_ranks(const linear_system *s, double *numbers, int32_t count)
{
    const ranks_t *ranks = s->ranks;
    if (ranks)
        ranks->all_reduce(ranks->in_place, numbers, count, ranks->numbers, ranks->sum, ranks->comm);
}

/* The numbers in `sent` to others, theirs to `received`; or back. */
static void exchange(const ranks_t *r, int back)
{
    if (back)
        r->all_to_all(r->received, r->their_counts, r->their_starts, r->numbers, r->sent, r->counts, r->starts, r->numbers, r->comm);
    else
        r->all_to_all(r->sent, r->counts, r->starts, r->numbers, r->received, r->their_counts, r->their_starts, r->numbers, r->comm);
}

static double times(const linear_system *s, const double *x, double *y)
{
    const ranks_t *ranks = s->ranks;
    if (ranks) {
        for (int64_t k = 0; k < ranks->rows; ++k)
            for (int a = 0; a < d; ++a)
                ranks->sent[k * d + a] = x[(int64_t)ranks->row[k] * 4 + a];
        exchange(ranks, 0);
    }
    double total = product(s, x, y);
    sum_over_ranks(s, &total, 1);
    return total;
}

static void weigh(const linear_system *s, float *z)
{
    for (int64_t i = 0; i < s->count; ++i)
        *(narrow *)(z + i * 4) *= s->weights[i];
}

/* z = sum over ranks of W (R' R)^-1 W z with the weights W, so that a vertex of several factors counts once. */
static void precondition_with_others(const linear_system *s, float *z)
{
    const ranks_t *ranks = s->overlap;
    const int64_t n = s->count;
    weigh(s, z);
    for (int64_t k = 0; k < ranks->rows; ++k)
        for (int a = 0; a < d; ++a)
            ranks->sent[k * d + a] = z[(int64_t)ranks->row[k] * 4 + a];
    exchange(ranks, 0);
    for (int64_t k = 0; k < s->others; ++k)
        for (int a = 0; a < 4; ++a)
            z[(n + k) * 4 + a] = a < d ? ranks->received[k * d + a] : 0.0;
    precondition_locally(s, z);
    for (int64_t k = 0; k < s->others; ++k)
        for (int a = 0; a < d; ++a)
            ranks->received[k * d + a] = z[(n + k) * 4 + a];
    exchange(ranks, 1);
    for (int64_t k = 0; k < ranks->rows; ++k)
        for (int a = 0; a < d; ++a)
            z[(int64_t)ranks->row[k] * 4 + a] += ranks->sent[k * d + a];
    weigh(s, z);
}

/* z = M r, where z is r at first; returns r' z. */
static double precondition(const linear_system *s, const double *r, double *coarse, float *z)
{
    const int64_t n = s->count;
    if (s->overlap)
        precondition_with_others(s, z);
    else
        precondition_locally(s, z);
    if (s->nodes)
        add_coarse_correction(s, r, coarse, z);
    wide sum = {0};
    for (int64_t i = 0; i < n; ++i)
        sum += *(const wide *)(r + i * 4) * __builtin_convertvector(*(const narrow *)(z + i * 4), wide);
    double total = across(sum);
    sum_over_ranks(s, &total, 1);
    return total;
}

static void pad(int64_t n, double factor, const double *x, double *out)
{
    for (int64_t i = 0; i < n; ++i)
        for (int a = 0; a < 4; ++a)
            out[i * 4 + a] = a < d ? factor * x[i * d + a] : 0.0;
}

static void strip(int64_t n, double factor, const double *x, double *out)
{
    for (int64_t i = 0; i < n; ++i)
        for (int a = 0; a < d; ++a)
            out[i * d + a] = factor * x[i * 4 + a];
}

/* The power of two next to the size of a vector (n, d), so that the preconditioner's single precision holds it in any unit; 1 of zero. */
static double unit_of(const linear_system *s, const double *x)
{
    double total = squares((int64_t)s->count * d, x);
    int exponent = 0;
    sum_over_ranks(s, &total, 1);
    if (total > 0.0 && isfinite(total))
        frexp(sqrt(total), &exponent);
    return ldexp(1.0, exponent);
}

/* y = A x, (count, d) each. Returns 1 if memory ran out. */
int symmetric_product(const linear_system *s, const double *x, double *y)
{
    double *v = malloc((size_t)s->count * 8 * sizeof(double) + 1);
    if (!v)
        return 1;
    pad(s->count, 1.0, x, v);
    times(s, v, v + 4 * s->count);
    strip(s->count, 1.0, v + 4 * s->count, y);
    free(v);
    return 0;
}

/* PETSc's numbers of the same reasons (KSPConvergedReason). */
enum { NO_MEMORY = 0, CONVERGED = 2, TOO_MANY = -3, INDEFINITE_PRECONDITIONER = -8, NOT_A_NUMBER = -9, INDEFINITE_MATRIX = -10 };

/* Solves A solution = right, (count, d) each, until sqrt(r' M r) is `tolerance` times what it is at zero, M the preconditioner. Begins at `start`,
 * or at zero without one. Returns one of the numbers above; *iterations: how many there were. */
int conjugate_gradients(const linear_system *s, const double *right, const double *start, double tolerance, int32_t most,
                        double *solution, int32_t *iterations)
{
    const int64_t m = 4 * (int64_t)s->count;
    double *r = calloc(4 * m + (int64_t)s->nodes * d + s->width, sizeof(double)), *p = r + m, *q = p + m, *x = q + m, *coarse = x + m;
    float *z = malloc((m + 4 * (int64_t)s->others) * sizeof(float) + 1);
    int reason = TOO_MANY;
    double first = 0.0, before = 1.0;
    *iterations = 0;
    if (!r || !z) {
        free(r), free(z);
        return NO_MEMORY;
    }
    const double unit = unit_of(s, right);
    pad(s->count, 1.0 / unit, right, r);
    for (int64_t k = 0; k < m; ++k)
        z[k] = r[k];
    if (start) {
        first = precondition(s, r, coarse, z);
        pad(s->count, 1.0 / unit, start, x);
        times(s, x, q);
        for (int64_t k = 0; k < m; ++k)
            z[k] = r[k] -= q[k];
    }
    for (int32_t i = 0;; ++i) {
        const double now = precondition(s, r, coarse, z);
        first = i || start ? first : now;
        *iterations = i;
        if (!isfinite(now))
            reason = NOT_A_NUMBER;
        else if (now < 0.0)
            reason = INDEFINITE_PRECONDITIONER;
        else if (now <= tolerance * tolerance * first)
            reason = CONVERGED;
        if (reason != TOO_MANY || i == most)
            break;
        const double beta = i ? now / before : 0.0;
        before = now;
        for (int64_t k = 0; k < m; ++k)
            p[k] = z[k] + beta * p[k];
        const double curvature = times(s, p, q);
        if (!(curvature > 0.0)) {
            reason = isfinite(curvature) ? INDEFINITE_MATRIX : NOT_A_NUMBER;
            break;
        }
        const double alpha = now / curvature;
        for (int64_t k = 0; k < m; ++k) {
            x[k] += alpha * p[k];
            z[k] = r[k] -= alpha * q[k];
        }
    }
    strip(s->count, unit, x, solution);
    free(r), free(z);
    return reason;
}
