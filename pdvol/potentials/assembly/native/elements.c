/* Loops over cells around compiled UFL kernels of energy densities psi(F): energies, gradients, and Hessians filtered to be positive
 * semi-definite.
 *
 * A kernel is that of psi, of its d x d first derivatives or of its d^2 x d^2 second ones, row-major, on the unit simplex. A linear
 * simplex's energy is its volume times psi, and its Hessian over the positions is K' H K: H is what is filtered, which is cheaper than the
 * whole block and does not depend on the cell's shape (Smith, de Goes, Kim 2019). */
#include <math.h>
#include <string.h>

#include "../../positive.h"
#include "interface.h"
#include "kernel.h"

/* MAX_PARAMETERS comes from the compiler's command line: its value is in __init__.py, which refuses more */

/* By what a kernel's tensor on the unit simplex is multiplied for a cell of that volume. */
INLINE double from_unit(int d, double volume)
{
    return (d == 2 ? 2.0 : 6.0) * volume;
}

/* A cell's coefficients as the kernel takes them: the parameters with F in between. */
INLINE void coefficients(int d, const cells_t *cells, const density_t *density, int64_t k, const double *x, double *w)
{
    const int np = density->np, before = density->at < 0 ? np : density->at;
    const double *own = density->parameters + k * np;
    memcpy(w, own, before * sizeof(double));
    if (density->at < 0)
        return;
    const int32_t *vertices = cells->vertices + k * (d + 1);
    const double *x0 = x + (int64_t)vertices[0] * d, *g = cells->inverse + k * d * d;
    double *F = w + before;
    for (int a = 0; a < d * d; ++a)
        F[a] = 0.0;
    for (int i = 0; i < d; ++i) {
        const double *xi = x + (int64_t)vertices[i + 1] * d;
        for (int a = 0; a < d; ++a)
            for (int j = 0; j < d; ++j)
                F[a * d + j] += (xi[a] - x0[a]) * g[i * d + j];
    }
    memcpy(F + d * d, own + before, (np - before) * sizeof(double));
}

INLINE double values(int d, const cells_t *cells, const density_t *density, const double *x)
{
    double total = 0.0, w[MAX_H + MAX_PARAMETERS];
    for (int64_t k = 0; k < cells->counted; ++k) {
        double value = 0.0;
        coefficients(d, cells, density, k, x, w);
        CALL(density->kernel, &value, w, 0, unit_simplex);
        total += from_unit(d, cells->volumes[k]) * value;
    }
    return total;
}

/* The sum of the energies of the cells that count, at local vertices x. */
double cell_values(const cells_t *cells, const density_t *density, const double *x)
{
    return cells->d == 3 ? values(3, cells, density, x) : values(2, cells, density, x);
}

INLINE void gradients(int d, const cells_t *cells, const density_t *density, const double *x, double *out)
{
    double w[MAX_H + MAX_PARAMETERS];
    for (int64_t k = 0; k < cells->count; ++k) {
        double P[MAX_H] = {0};
        const double *g = cells->inverse + k * d * d, scale = from_unit(d, cells->volumes[k]);
        const int32_t *vertices = cells->vertices + k * (d + 1);
        coefficients(d, cells, density, k, x, w);
        CALL(density->kernel, P, w, 0, unit_simplex);
        for (int a = 0; a < d; ++a) {
            double others = 0.0;
            for (int i = 0; i < d; ++i) {
                double force = 0.0;
                for (int j = 0; j < d; ++j)
                    force += P[a * d + j] * g[i * d + j];
                out[(int64_t)vertices[i + 1] * d + a] += scale * force;
                others += force;
            }
            out[(int64_t)vertices[0] * d + a] -= scale * others;
        }
    }
}

/* Adds the cells' gradients to out (local vertices x d). */
void cell_gradients(const cells_t *cells, const density_t *density, const double *x, double *out)
{
    if (cells->d == 3)
        gradients(3, cells, density, x, out);
    else
        gradients(2, cells, density, x, out);
}

INLINE void hessians(int d, const cells_t *cells, const density_t *density, const double *x, const int32_t *slots, int mode, double weight, double *out)
{
    const int h = d * d;
    double w[MAX_H + MAX_PARAMETERS];
    for (int64_t k = 0; k < cells->count; ++k) {
        double H[MAX_H * MAX_H] = {0}, g[4][3];
        coefficients(d, cells, density, k, x, w);
        CALL(density->kernel, H, w, 0, unit_simplex);
        if (mode)
            filter(d * d, H, mode);
        for (int j = 0; j < d; ++j) {
            g[0][j] = 0.0;
            for (int i = 0; i < d; ++i) {
                g[i + 1][j] = cells->inverse[k * h + i * d + j];
                g[0][j] -= g[i + 1][j];
            }
        }
        const double scale = weight * from_unit(d, cells->volumes[k]);
        const int32_t *slot = slots + k * (d + 1) * (d + 2) / 2;
        for (int i = 0; i <= d; ++i) {
            double T[3][MAX_H]; /* H contracted with g_i on the left */
            for (int a = 0; a < d; ++a)
                for (int q = 0; q < h; ++q) {
                    T[a][q] = 0.0;
                    for (int j = 0; j < d; ++j)
                        T[a][q] += g[i][j] * H[(a * d + j) * h + q];
                }
            for (int l = i; l <= d; ++l, ++slot) {
                if (*slot == -1)
                    continue;
                double *block = out + (int64_t)(*slot >= 0 ? *slot : -2 - *slot) * h;
                for (int a = 0; a < d; ++a)
                    for (int b = 0; b < d; ++b) {
                        double sum = 0.0;
                        for (int m = 0; m < d; ++m)
                            sum += T[a][b * d + m] * g[l][m];
                        block[*slot >= 0 ? a * d + b : b * d + a] += scale * sum;
                    }
            }
        }
    }
}

/* Adds weight times the cells' Hessians to the blocks `out` (d x d each); `slots` has one entry per pair i <= j of a cell's vertices:
 * s >= 0 adds block s as it is, s <= -2 transposed at -2 - s, -1 nowhere. mode 0: unfiltered, 1: negative eigenvalues cut off, 2: their
 * sizes taken. */
void cell_hessians(const cells_t *cells, const density_t *density, const double *x, const int32_t *slots, int mode, double weight, double *out)
{
    if (cells->d == 3)
        hessians(3, cells, density, x, slots, mode, weight, out);
    else
        hessians(2, cells, density, x, slots, mode, weight, out);
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
        for (int step = 0; step < 60; ++step) {
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
INLINE void volume_along(int d, const double *E, const double *P, double *c)
{
    if (d == 2) {
        c[0] = E[0] * E[3] - E[1] * E[2];
        c[1] = E[0] * P[3] + P[0] * E[3] - E[1] * P[2] - P[1] * E[2];
        c[2] = P[0] * P[3] - P[1] * P[2];
        c[3] = 0.0;
        return;
    }
    double e[9], p[9];
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            e[3 * i + j] = E[3 * i1 + j1] * E[3 * i2 + j2] - E[3 * i1 + j2] * E[3 * i2 + j1];
            p[3 * i + j] = P[3 * i1 + j1] * P[3 * i2 + j2] - P[3 * i1 + j2] * P[3 * i2 + j1];
        }
    c[0] = E[0] * e[0] + E[1] * e[1] + E[2] * e[2];
    c[3] = P[0] * p[0] + P[1] * p[1] + P[2] * p[2];
    c[1] = c[2] = 0.0;
    for (int i = 0; i < 9; ++i)
        c[1] += e[i] * P[i], c[2] += E[i] * p[i];
}

/* The edges (d x d) of cell k from its first vertex on, at x. */
INLINE void edges_of(int d, const cells_t *cells, int64_t k, const double *x, double *E)
{
    const int32_t *vertices = cells->vertices + k * (d + 1);
    for (int i = 0; i < d; ++i)
        for (int a = 0; a < d; ++a)
            E[i * d + a] = x[(int64_t)vertices[i + 1] * d + a] - x[(int64_t)vertices[0] * d + a];
}

INLINE double cells_step(int d, const cells_t *cells, const double *x, const double *p, double keep)
{
    double step = 1.0;
    for (int64_t k = 0; k < cells->counted; ++k) {
        double E[9], P[9], c[4];
        edges_of(d, cells, k, x, E), edges_of(d, cells, k, p, P);
        volume_along(d, E, P, c);
        const double sign = c[0] < 0.0 ? -1.0 : 1.0;
        for (int i = 0; i < 4; ++i)
            c[i] *= sign;
        c[0] *= 1.0 - keep;
        if (fabs(c[1]) + fabs(c[2]) + fabs(c[3]) < c[0])
            continue; /* most cells: no root in [0, 1] */
        const double t = first_root(c);
        if (t < step)
            step = t;
    }
    return step;
}

/* Largest step in (0, 1] for which the volume of no cell that counts falls below `keep` times what it is at t = 0 along x + t p. */
double volume_step(const cells_t *cells, const double *x, const double *p, double keep)
{
    return cells->d == 3 ? cells_step(3, cells, x, p, keep) : cells_step(2, cells, x, p, keep);
}

/* How many cells that count, positive at rest, have no volume or a negative one at x. */
int64_t inverted_cells(const cells_t *cells, const double *x)
{
    int64_t found = 0;
    for (int64_t k = 0; k < cells->counted; ++k) {
        double E[9];
        edges_of(cells->d, cells, k, x, E);
        const double volume = cells->d == 2 ? E[0] * E[3] - E[1] * E[2]
                                            : E[0] * (E[4] * E[8] - E[5] * E[7]) + E[1] * (E[5] * E[6] - E[3] * E[8]) + E[2] * (E[3] * E[7] - E[4] * E[6]);
        found += !(volume > 0.0);
    }
    return found;
}
