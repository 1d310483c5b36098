/* The barrier over active pairs: sums of its law, gradients and blocks of Hessians. */
#include "law.h"
#include "products.h"

/* How many of a contact's vertices count: the others have the coefficient zero. */
INLINE int used(const double *coefficients)
{
    int n = 4;
    while (n > 1 && coefficients[n - 1] == 0.0)
        --n;
    return n;
}

/* The sum of weights times the law over contacts that count here, and the gradient of all by the vertices (n, d), added to `gradient`. */
double barrier_sum(int d, const contacts_t *all, double dhat, double kappa, double *gradient)
{
    double total = 0.0, slope, second;
    for (int64_t k = 0; k < all->count; ++k) {
        const double *gap = all->gaps + d * k, *c = all->coefficients + 4 * k;
        const double energy = all->weights[k] * law(dot(d, gap, gap), dhat, kappa, &slope, &second);
        total += all->counted[k] ? energy : 0.0;
        for (int i = 0, n = used(c); i < n; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * all->vertices[4 * k + i] + j] += 2.0 * all->weights[k] * slope * c[i] * gap[j];
    }
    for (int64_t f = 0; f < all->faded; ++f) {
        const int64_t k = all->fading[f];
        const double *gap = all->gaps + d * k, energy = law(dot(d, gap, gap), dhat, kappa, &slope, &second);
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * all->vertices[4 * k + i] + j] += energy * all->fades[12 * f + 3 * i + j];
    }
    return total;
}

/* The pressure of each contact: minus the law's derivative by the gap. */
void contact_pressures(int d, const contacts_t *all, double dhat, double kappa, double *pressures)
{
    for (int64_t k = 0; k < all->count; ++k) {
        const double squared = dot(d, all->gaps + d * k, all->gaps + d * k);
        double slope, second;
        law(squared, dhat, kappa, &slope, &second);
        pressures[k] = -2.0 * sqrt(squared) * slope;
    }
}

/* Blocks being found of vertices that have rows (`rows`, -1: none), on or right of the diagonal, in the rows from `first` to before `last`;
 * of two vertices of which another rank has one, also left of it. */
typedef struct {
    const int64_t *rows;
    int64_t first, last, count;
    int64_t *to_rows, *to_columns;
    double *blocks;
} out_t;

/* Adds a block (d x d) of two vertices; returns where it goes, row by row, or 0 where it is not in these rows. */
INLINE double *add_block(int d, out_t *out, int32_t v, int32_t w, int *turned)
{
    const int64_t a = out->rows[v], b = out->rows[w], lower = a < b ? a : b, upper = a < b ? b : a;
    const int64_t row = lower < out->first ? upper : lower;
    if (lower < 0 || row < out->first || row >= out->last)
        return 0;
    *turned = row == b;
    out->to_rows[out->count] = row - out->first, out->to_columns[out->count] = row == a ? b : a;
    return out->blocks + (int64_t)(d * d) * out->count++;
}

/* Blocks c_i c_j T of contacts with symmetric tensors T (count, d, d). Returns how many: up to 10 count. */
int64_t tensor_blocks(int d, const contacts_t *all, const double *tensors, const int64_t *rows, int64_t first, int64_t last, int64_t *out_rows,
                      int64_t *out_columns, double *blocks)
{
    out_t out = {rows, first, last, 0, out_rows, out_columns, blocks};
    for (int64_t k = 0; k < all->count; ++k) {
        const double *c = all->coefficients + 4 * k, *T = tensors + d * d * k;
        const int32_t *v = all->vertices + 4 * k;
        double trace = 0.0, *to;
        int turned;
        for (int p = 0; p < d; ++p)
            trace += T[(d + 1) * p];
        for (int i = 0, n = used(c); i < n; ++i)
            for (int j = i; j < n; ++j)
                if (c[i] * c[j] * trace != 0.0 && (to = add_block(d, &out, v[i], v[j], &turned)))
                    for (int p = 0; p < d * d; ++p)
                        to[p] = c[i] * c[j] * T[p];
    }
    return out.count;
}

/* The Hessian over a contact's n vertices of its weight times the law, or (`convex`) its convex part: the curvature along the gap and across it, where
 * they are positive, and of each parameter's u v' + v u' + v v' (`rotation`) one of two eigenvalues. */
INLINE void contact_hessian(int d, int n, const double *c, const double *const *x, const double *gap, double weight, double dhat, double kappa, int convex,
                            blocks_t H)
{
    double slope, second, t[2][3], vector[12], u[2][12], v[2][12], edges[2][4] = OF_EDGES, facet[2][4] = {{0.0, 1.0, -1.0, 0.0}, {0.0, 1.0, 0.0, -1.0}};
    const double squared = dot(d, gap, gap);
    law(squared, dhat, kappa, &slope, &second);
    slope *= 2.0 * weight;
    const int of_edges = c[1] > 0.0, parameters = of_edges ? 2 : (c[2] != 0.0) + (c[3] != 0.0);
    rotation(d, parameters, c, of_edges ? edges : facet, x, gap, t, u, v);
    const double along = 4.0 * weight * second + slope / squared;
    outer(d, c, gap, vector);
    if (along > 0.0 || !convex)
        add_square(d, n, along, vector, H);
    if (parameters + 1 < d && (slope > 0.0 || !convex)) { /* normals beside the gap's own */
        double normal[2][3];
        if (d == 2)
            normal[0][0] = -gap[1], normal[0][1] = gap[0];
        else {
            const int least = fabs(gap[0]) < fabs(gap[1]) ? (fabs(gap[0]) < fabs(gap[2]) ? 0 : 2) : (fabs(gap[1]) < fabs(gap[2]) ? 1 : 2);
            const double any[3] = {least == 0, least == 1, least == 2}, *a = parameters ? t[0] : any;
            cross(gap, a, normal[0]), cross(gap, normal[0], normal[1]);
        }
        for (int e = 0; e < d - 1 - parameters; ++e) {
            outer(d, c, normal[e], vector);
            add_square(d, n, slope / dot(d, normal[e], normal[e]), vector, H);
        }
    }
    for (int e = 0; e < parameters; ++e) {
        double uu = 0.0, vv = 0.0;
        for (int q = 0; q < n * d; ++q)
            uu += u[e][q] * u[e][q], vv += v[e][q] * v[e][q];
        const double root = sqrt(vv * vv + 4.0 * uu * vv);
        for (int side = -1; side < 2; side += 2) {
            const double value = 0.5 * (vv + side * root), size = -slope * value;
            if (size < 0.0 && convex)
                continue;
            for (int q = 0; q < n * d; ++q)
                vector[q] = vv * u[e][q] + value * v[e][q];
            add_square(d, n, size / (uu * vv * vv + value * value * vv), vector, H);
        }
    }
}

/* Cuts off negative eigenvalues of a symmetric 12 x 12 matrix that has none but zero for translations: over three differences of the four
 * vertices, which are orthonormal. */
static void clamp_matrix(blocks_t H)
{
    static const double differences[3][4] = {{0.5, 0.5, -0.5, -0.5}, {0.5, -0.5, 0.5, -0.5}, {0.5, -0.5, -0.5, 0.5}};
    double A[9 * 9] = {0.0};
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b) {
                    const double right = differences[a][i] * differences[b][j], left = i < j ? differences[a][j] * differences[b][i] : 0.0;
                    for (int p = 0; p < 3; ++p)
                        for (int q = 0; q < 3; ++q)
                            A[9 * (3 * a + p) + 3 * b + q] += right * H[n][3 * p + q] + left * H[n][3 * q + p];
                }
    if (!filter(9, A, 1))
        return;
    memset(H, 0, sizeof(blocks_t));
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int a = 0; a < 3; ++a)
                for (int b = 0; b < 3; ++b)
                    for (int p = 0; p < 3; ++p)
                        for (int q = 0; q < 3; ++q)
                            H[n][3 * p + q] += differences[a][i] * differences[b][j] * A[9 * (3 * a + p) + 3 * b + q];
}

/* Blocks of the Hessian of `factor` times the sum of weights times the law, or of its convex part, at positions x, as tensor_blocks has them. */
int64_t barrier_blocks(int d, const contacts_t *all, const double *x, double dhat, double kappa, double factor, int convex, const int64_t *rows,
                       int64_t first, int64_t last, int64_t *out_rows, int64_t *out_columns, double *blocks)
{
    out_t out = {rows, first, last, 0, out_rows, out_columns, blocks};
    for (int64_t k = 0, f = 0; k < all->count; ++k) {
        blocks_t H = {{0.0}};
        const int32_t *v = all->vertices + 4 * k;
        const double *c = all->coefficients + 4 * k, *gap = all->gaps + d * k, weight = factor * all->weights[k], *at[4];
        const int fade = f < all->faded && all->fading[f] == k, n = used(c);
        for (int i = 0; i < 4; ++i)
            at[i] = x + (int64_t)d * v[i];
        if (d == 2 && n == 3)
            contact_hessian(2, 3, c, at, gap, weight, dhat, kappa, convex, H);
        else if (d == 2)
            contact_hessian(2, 2, c, at, gap, weight, dhat, kappa, convex, H);
        else if (n == 4)
            contact_hessian(3, 4, c, at, gap, weight, dhat, kappa, convex && !fade, H);
        else if (n == 3)
            contact_hessian(3, 3, c, at, gap, weight, dhat, kappa, convex, H);
        else
            contact_hessian(3, 2, c, at, gap, weight, dhat, kappa, convex, H);
        if (fade) {
            double slope, second, force[12];
            const double energy = factor * law(dot(3, gap, gap), dhat, kappa, &slope, &second);
            for (int q = 0; q < 90; ++q)
                H[q / 9][q % 9] += energy * all->curves[90 * f + q];
            outer(3, c, gap, force);
            add_product(3, 4.0 * factor * slope, force, all->fades + 12 * f, H);
            if (convex)
                clamp_matrix(H);
            ++f;
        }
        for (int i = 0, row = 0; i < n; row += 4 - i++)
            for (int j = i, turned; j < n; ++j) {
                const double *block = H[row + j - i];
                double *to = c[i] * c[j] != 0.0 ? add_block(d, &out, v[i], v[j], &turned) : 0;
                for (int p = 0; to && p < d; ++p)
                    for (int q = 0; q < d; ++q)
                        to[d * p + q] = block[turned ? d * q + p : d * p + q];
            }
    }
    return out.count;
}
