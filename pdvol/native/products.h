/* Hessians over the vertices of contacts, as blocks: products of vectors, second derivatives of gaps between closest points, and where blocks go. */
#pragma once
#include "surface.h"

/* Symmetric 12 x 12 (8 x 8) matrices over four vertices: blocks on or right of the diagonal, row by row. */
typedef double blocks_t[10][9];

/* Adds scale (u v' + v u') / 2. */
INLINE void add_product(double scale, const double *u, const double *v, blocks_t H)
{
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int p = 0; p < d; ++p)
                for (int q = 0; q < d; ++q)
                    H[n][d * p + q] += 0.5 * scale * (u[d * i + p] * v[d * j + q] + v[d * i + p] * u[d * j + q]);
}

/* Adds scale u u', over the first n vertices alone. */
INLINE void add_square(int n, double scale, const double *u, blocks_t H)
{
    for (int i = 0, row = 0; i < n; row += 4 - i++)
        for (int j = i; j < n; ++j)
            for (int p = 0; p < d; ++p)
                for (int q = 0; q < d; ++q)
                    H[row + j - i][d * p + q] += scale * (u[d * i + p] * u[d * j + q]);
}

INLINE void outer(const double *c, const double *v, double *out)
{
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < d; ++j)
            out[d * i + j] = c[i] * v[j];
}

/* The gap's rotation. Its vector g = sum c_i x_i over closest points that depend on `parameters` numbers; `b` has the derivatives of the
 * coefficients by them. Gives for each, after they have been made orthonormal, u = c t (t its tangent) and v = b g: with their parameters
 * eliminated, (g^2)'' = 2 c_i c_j I - 2 sum (u + v)(u + v)'. Tangents (d each) go to `t`. */
INLINE void rotation(int parameters, const double *c, double (*b)[4], const double *const *x, const double *gap, double (*t)[3],
                     double (*u)[12], double (*v)[12])
{
    for (int e = 0; e < parameters; ++e) {
        for (int j = 0; j < d; ++j) {
            t[e][j] = 0.0;
            for (int i = 0; i < 4; ++i)
                t[e][j] += b[e][i] * x[i][j];
        }
        if (e == 1) {
            const double along = dot(t[1], t[0]);
            for (int j = 0; j < d; ++j)
                t[1][j] -= along * t[0][j];
            for (int i = 0; i < 4; ++i)
                b[1][i] -= along * b[0][i];
        }
        const double size = sqrt(dot(t[e], t[e]));
        for (int j = 0; j < d; ++j)
            t[e][j] /= size;
        for (int i = 0; i < 4; ++i)
            b[e][i] /= size;
        outer(c, t[e], u[e]), outer(b[e], gap, v[e]);
    }
}

/* Adds scale times the Hessian of the squared gap. */
INLINE void add_distance(double scale, int parameters, const double *c, double (*b)[4], const double *const *x, const double *gap,
                         blocks_t H)
{
    double t[2][3], u[2][12], v[2][12];
    rotation(parameters, c, b, x, gap, t, u, v);
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int p = 0; p < d; ++p)
                H[n][(d + 1) * p] += 2.0 * scale * c[i] * c[j];
    for (int e = 0; e < parameters; ++e) {
        for (int q = 0; q < 4 * d; ++q)
            u[e][q] += v[e][q];
        add_square(4, -2.0 * scale, u[e], H);
    }
}

/* Derivatives of the coefficients of two edges' closest points by the shares along them. */
#define OF_EDGES {{-1.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, -1.0}}

/* How many of a contact's vertices count: the others have the coefficient zero. */
INLINE int used(const double *coefficients)
{
    int n = 4;
    while (n > 1 && coefficients[n - 1] == 0.0)
        --n;
    return n;
}

/* Whether this rank adds a contact's force on its i-th vertex: on an obstacle, which no rank owns, those that count here do. */
INLINE int adds(const contacts_t *all, const contact_t *at, int i)
{
    return at->counted || at->vertices[i] < all->of_bodies;
}

/* Adds a block (d x d) of two vertices; returns where it goes, row by row, or 0 where it is not in these rows. */
INLINE double *add_block(out_t *out, int32_t v, int32_t w, int *turned)
{
    const int64_t a = out->rows[v], b = out->rows[w], lower = a < b ? a : b, upper = a < b ? b : a;
    const int64_t row = lower < out->first ? upper : lower;
    if (lower < 0 || row < out->first || row >= out->last)
        return 0;
    *turned = row == b;
    out->to_rows[out->count] = row - out->first, out->to_columns[out->count] = row == a ? b : a;
    return out->blocks + (int64_t)(d * d) * out->count++;
}
