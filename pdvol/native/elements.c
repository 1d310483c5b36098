/* Loops over domains around compiled UFL kernels of energy densities psi(F): energies, gradients, and Hessians filtered to be positive
 * semi-definite.
 *
 * A kernel is that of psi, of its d x d first derivatives or of its d^2 x d^2 second ones, row-major. A domain's energy is its volume times psi,
 * and its Hessian over the positions is K' H K: H is what is filtered, which is cheaper than the whole block and does not depend on the domain's
 * shape (Smith, de Goes, Kim 2019). */
#include "domain.h"

/* MAX_PARAMETERS comes from the compiler's command line: its value is in __init__.py, which refuses more */

/* det A of a d x d matrix. */
INLINE lanes determinant(const lanes *A)
{
    if (d == 2)
        return A[0] * A[3] - A[1] * A[2];
    return A[0] * (A[4] * A[8] - A[5] * A[7]) + A[1] * (A[5] * A[6] - A[3] * A[8]) + A[2] * (A[3] * A[7] - A[4] * A[6]);
}

/* Whether the densities of the first `used` domains are all zero. */
INLINE int idle(const domains_t *domains, const lanes *F, int used)
{
    if (!(domains->ceiling > 0.0))
        return 0;
    const lanes J = determinant(F);
    for (int l = 0; l < used; ++l)
        if (!(J[l] >= domains->ceiling))
            return 0;
    return 1;
}

/* Whether det F > 0 in the first `used` domains. */
INLINE int upright(const lanes *F, int used)
{
    const lanes J = determinant(F);
    for (int l = 0; l < used; ++l)
        if (!(J[l] > 0.0))
            return 0;
    return 1;
}

INLINE void strains(int cells, const domains_t *domains, const double *x, double *out)
{
    for (int64_t k = 0; k < domains->count; ++k) {
        double F[9];
        gradient_of(domain_at(cells, domains, k), x, F);
        for (int i = 0; i < d; ++i)
            for (int j = 0; j < d; ++j) {
                double sum = 0.0;
                for (int a = 0; a < d; ++a)
                    sum += F[a * d + i] * F[a * d + j];
                *out++ = sum;
            }
    }
}

/* C = F' F of each domain (count, d, d) at positions x. */
void domain_strains(const domains_t *domains, const double *x, double *out)
{
    EACH(domains, strains, x, out);
}

INLINE double values(int cells, const domains_t *domains, const density_t *density, const double *x)
{
    double total = 0.0;
    for (int64_t first = 0; first < domains->counted; first += LANES) {
        const int used = lanes_used(domains->counted, first);
        lanes F[MAX_H], w[MAX_H + MAX_PARAMETERS], value;
        gradients_of(cells, domains, first, x, F);
        if (domains->oriented && !upright(F, used))
            return INFINITY;
        if (idle(domains, F, used))
            continue;
        coefficients(density, first, d * d, F, w);
        CALL(density->kernel, &value, w);
        for (int l = 0; l < used; ++l)
            total += domains->volumes[first + l] * value[l];
    }
    return total;
}

/* The sum of the energies of the domains that count, at local vertices x. */
double domain_values(const domains_t *domains, const density_t *density, const double *x)
{
    return EACH(domains, values, density, x);
}

INLINE void gradients(int cells, const domains_t *domains, const density_t *density, const double *x, double *out)
{
    for (int64_t first = 0; first < domains->count; first += LANES) {
        const int used = lanes_used(domains->count, first);
        const lanes scale = volumes_of(domains, first);
        lanes F[MAX_H], w[MAX_H + MAX_PARAMETERS], P[MAX_H];
        gradients_of(cells, domains, first, x, F);
        if (idle(domains, F, used))
            continue;
        coefficients(density, first, d * d, F, w);
        CALL(density->kernel, P, w);
        for (int a = 0; a < d * d; ++a)
            P[a] *= scale;
        for (int l = 0; l < used; ++l) {
            const domain_t domain = domain_at(cells, domains, first + l);
            four columns[3], others = {0.0};
            for (int j = 0; j < d; ++j)
                columns[j] = d == 3 ? (four){P[j][l], P[3 + j][l], P[6 + j][l]} : (four){P[j][l], P[2 + j][l]};
            for (int64_t i = 0; i < domain.n - 1; ++i) {
                four force = {0.0};
                for (int j = 0; j < d; ++j)
                    force += columns[j] * domain.gradients[i * d + j];
                others += force;
                for (int a = 0; a < d; ++a)
                    out[(int64_t)domain.vertices[i + 1] * d + a] += force[a];
            }
            for (int a = 0; a < d; ++a)
                out[(int64_t)domain.vertices[0] * d + a] -= others[a];
        }
    }
}

/* Adds the domains' gradients to out (local vertices x d). */
void domain_gradients(const domains_t *domains, const density_t *density, const double *x, double *out)
{
    EACH(domains, gradients, density, x, out);
}

INLINE void hessians(int cells, const domains_t *domains, const density_t *density, const double *x, const int32_t *slots, int mode, double weight,
                     double *out)
{
    double H[MAX_H * MAX_H], numbers[9] = {0};
    block_t blocks[3][3];
    for (int64_t first = 0; first < domains->count; first += LANES) {
        const int used = lanes_used(domains->count, first);
        lanes F[MAX_H], w[MAX_H + MAX_PARAMETERS], all[MAX_H * MAX_H];
        gradients_of(cells, domains, first, x, F);
        const int none = idle(domains, F, used);
        if (!none) {
            coefficients(density, first, dd, F, w);
            CALL(density->kernel, all, w);
        }
        for (int l = 0; l < used; ++l) {
            const domain_t domain = domain_at(cells, domains, first + l);
            if (none) {
                slots += domain.n * (domain.n + 1) / 2;
                continue;
            }
            for (int i = 0; i < dd * dd; ++i)
                H[i] = all[i][l];
            if (mode)
                filter(dd, H, mode);
            const double scale = weight * domains->volumes[first + l];
            for (int j = 0; j < d; ++j)
                for (int m = 0; m < d; ++m) {
                    for (int a = 0; a < d; ++a)
                        for (int b = 0; b < d; ++b)
                            numbers[a * d + b] = scale * H[(a * d + j) * dd + b * d + m];
                    blocks[j][m] = (block_t){{{*(const four *)numbers, *(const four *)(numbers + 4)}}, numbers[8]};
                }
            slots = add_blocks(cells, domain, blocks, slots, out);
        }
    }
}

/* Adds weight times the domains' Hessians to the blocks `out` (d x d each), with slots as `add_blocks` takes them. mode 0: unfiltered, 1: negative
 * eigenvalues cut off, 2: their sizes taken. */
void domain_hessians(const domains_t *domains, const density_t *density, const double *x, const int32_t *slots, int mode, double weight, double *out)
{
    EACH(domains, hessians, density, x, slots, mode, weight, out);
}

/* First t in (0, 1] where the polynomial c0 + c1 t + c2 t^2 + c3 t^3 (c0 > 0) falls to zero; 2 if it does not. */
static double first_root(const double *c)
{
    double cuts[4] = {0.0, 1.0, 1.0, 1.0};
    int n = 0;
    const double a = 3.0 * c[3], b = 2.0 * c[2], e = c[1];
    const double disc = b * b - 4.0 * a * e;
    if (disc >= 0.0) {
        const double q = -0.5 * (b + (b >= 0.0 ? sqrt(disc) : -sqrt(disc)));
        double r[2] = {a != 0.0 ? q / a : 2.0, q != 0.0 ? e / q : 2.0};
        if (r[0] > r[1]) {
            const double swap = r[0];
            r[0] = r[1], r[1] = swap;
        }
        for (int i = 0; i < 2; ++i)
            if (r[i] > 0.0 && r[i] < 1.0)
                cuts[++n] = r[i];
    }
    cuts[n + 1] = 1.0;
    for (int i = 0; i <= n; ++i) {
        double lo = cuts[i], hi = cuts[i + 1];
        if (c[0] + hi * (c[1] + hi * (c[2] + hi * c[3])) > 0.0)
            continue;
        for (int step = 0; step < MAX_ROUNDS; ++step) {
            const double mid = 0.5 * (lo + hi);
            if (c[0] + mid * (c[1] + mid * (c[2] + mid * c[3])) > 0.0)
                lo = mid;
            else
                hi = mid;
        }
        return lo;
    }
    return 2.0;
}

/* det(E + t P) = c0 + c1 t + c2 t^2 + c3 t^3 for d x d matrices, through their cofactors. */
INLINE void volume_along(const lanes *E, const lanes *P, lanes *c)
{
    if (d == 2) {
        c[0] = E[0] * E[3] - E[1] * E[2];
        c[1] = E[0] * P[3] + P[0] * E[3] - E[1] * P[2] - P[1] * E[2];
        c[2] = P[0] * P[3] - P[1] * P[2];
        c[3] = (lanes){0.0};
        return;
    }
    for (int i = 0; i < 4; ++i)
        c[i] = (lanes){0.0};
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            const lanes e = E[3 * i1 + j1] * E[3 * i2 + j2] - E[3 * i1 + j2] * E[3 * i2 + j1];
            const lanes p = P[3 * i1 + j1] * P[3 * i2 + j2] - P[3 * i1 + j2] * P[3 * i2 + j1];
            if (i == 0)
                c[0] += E[j] * e, c[3] += P[j] * p;
            c[1] += e * P[3 * i + j], c[2] += E[3 * i + j] * p;
        }
}

/* What has the sign of det F and changes with it, at v, of the domains from `first` on: a cell's edges (d x d) from its first vertex on, or F
 * itself. */
INLINE void spanned(int cells, const domains_t *domains, int64_t first, const double *v, lanes *E)
{
    if (!cells) {
        gradients_of(cells, domains, first, v, E);
        return;
    }
    for (int l = 0; l < LANES; ++l) {
        const domain_t domain = domain_in(cells, domains, first, l);
        for (int i = 0; i < d; ++i)
            for (int a = 0; a < d; ++a)
                E[i * d + a][l] = v[(int64_t)domain.vertices[i + 1] * d + a] - v[(int64_t)domain.vertices[0] * d + a];
    }
}

INLINE double domains_step(int cells, const domains_t *domains, const double *x, const double *p, double keep)
{
    double step = 1.0;
    for (int64_t first = 0; first < domains->counted; first += LANES) {
        lanes E[MAX_H], P[MAX_H], c[4];
        spanned(cells, domains, first, x, E), spanned(cells, domains, first, p, P);
        volume_along(E, P, c);
        const lanes left = (1.0 - keep) * magnitude(c[0]);
        const mask free = magnitude(c[1]) + magnitude(c[2]) + magnitude(c[3]) < left; /* most domains: no root in [0, 1] */
        for (int l = 0; l < lanes_used(domains->counted, first); ++l)
            if (!free[l]) {
                const double sign = c[0][l] < 0.0 ? -1.0 : 1.0, own[4] = {left[l], sign * c[1][l], sign * c[2][l], sign * c[3][l]};
                const double t = first_root(own);
                step = t < step ? t : step;
            }
    }
    return step;
}

/* Largest step in (0, 1] for which det F of no domain that counts falls below `keep` times what it is at t = 0 along x + t p. */
double volume_step(const domains_t *domains, const double *x, const double *p, double keep)
{
    return EACH(domains, domains_step, x, p, keep);
}
