/* The active pairs of a contact surface, and sums over them. */
#include "surface.h"

/* sin^2 of the angle between edges below which their contact fades: the pair's normal is lost there (Li et al. 2020, section 4.2) */
#define PARALLEL 1e-3

/* Contacts being found: up to four vertices each and their coefficients in the gap vector, and a weight. */
typedef struct {
    int64_t count, capacity, faded, fades_capacity;
    int32_t *vertices;
    double *coefficients, *gaps, *weights, *fades; /* fades (faded, 12): derivative of the weight by the vertices */
    double *curves;                                /* (faded, 10, 9): second derivatives, blocks on or right of the diagonal */
    int64_t *fading;                               /* (faded) indices of the contacts whose weights depend on positions */
} contacts_t;

/* What a point has been seen to be nearest to: a vertex, an edge or a facet, and how often unions count it. */
typedef struct {
    int32_t weight;
    closest_t at;
    int32_t corners[3];
} nearest_t;

INLINE void emit(int d, contacts_t *out, int n, const int32_t *vertices, const double *coefficients, const double *gap, double weight)
{
    const int64_t k = out->count++;
    if (k >= out->capacity)
        return;
    for (int i = 0; i < 4; ++i) {
        out->vertices[4 * k + i] = vertices[i < n ? i : 0];
        out->coefficients[4 * k + i] = i < n ? coefficients[i] : 0.0;
    }
    for (int j = 0; j < d; ++j)
        out->gaps[d * k + j] = gap[j];
    out->weights[k] = weight;
}

/* Scratch memory of one call: when each vertex and edge was met last, and where its sum is. */
typedef struct {
    int32_t *met, *slot; /* (vertices + edges + facets) each */
    nearest_t *nearest;
} scratch_t;

/* Adds `weight` to the sum of the primitive that the corners name (`key`), or begins one. */
INLINE void add(scratch_t *scratch, int64_t key, int32_t stamp, int32_t *count, int32_t weight, const closest_t *at, const int32_t *corners)
{
    if (scratch->met[key] != stamp) {
        scratch->met[key] = stamp, scratch->slot[key] = (*count)++;
        nearest_t *fresh = scratch->nearest + scratch->slot[key];
        fresh->weight = 0, fresh->at = *at;
        for (int i = 0; i < at->kind; ++i)
            fresh->corners[i] = corners[at->corner[i]];
    }
    scratch->nearest[scratch->slot[key]].weight += weight;
}

/* Contacts of one point with n facets near it: the union of the facets counts once where they share edges and vertices (inclusion and exclusion). */
INLINE void point_contacts(int d, const surface_t *s, const double *x, double reach, int32_t p, int64_t n, const int32_t *pairs, int32_t stamp,
                           int32_t *counted, scratch_t *scratch, contacts_t *out)
{
    int32_t count = 0;
    const double *point = x + (int64_t)d * p;
    for (int64_t k = 0; k < n; ++k) {
        const int64_t f = pairs[2 * k + 1];
        const int32_t *facet = s->facet + d * f;
        const double *corners[3] = {x + (int64_t)d * facet[0], x + (int64_t)d * facet[1], d == 3 ? x + (int64_t)d * facet[2] : 0};
        closest_t at;
        if (!(to_facet(d, point, corners, &at) < reach))
            continue;
        const int64_t key = at.kind == 1   ? facet[at.corner[0]]
                            : at.kind == d ? s->vertices + s->edges + f
                                           : s->vertices + s->facet_edges[3 * f + at.corner[0]];
        add(scratch, key, stamp, &count, 1, &at, facet);
        for (int i = 0; d == 3 && i < 3; ++i) {
            const int64_t e = s->facet_edges[3 * f + i];
            if (!s->edge_share[e] || counted[s->vertices + e] == stamp)
                continue;
            counted[s->vertices + e] = stamp;
            const int32_t *edge = s->edge + 2 * e;
            if (to_edge(3, point, x + 3 * (int64_t)edge[0], x + 3 * (int64_t)edge[1], &at) < reach)
                add(scratch, at.kind == 1 ? edge[at.corner[0]] : s->vertices + e, stamp, &count, s->edge_share[e], &at, edge);
        }
        for (int i = 0; i < d; ++i) {
            const int32_t v = facet[i];
            if (!s->vertex_share[v] || counted[v] == stamp)
                continue;
            counted[v] = stamp;
            at.kind = 1, at.corner[0] = 0, at.share[0] = 1.0;
            minus(d, point, corners[i], at.gap);
            if (dot(d, at.gap, at.gap) < reach)
                add(scratch, v, stamp, &count, s->vertex_share[v], &at, &v);
        }
    }
    for (int32_t k = 0; k < count; ++k) {
        const nearest_t *found = scratch->nearest + k;
        int32_t vertices[4] = {p};
        double coefficients[4] = {1.0};
        for (int i = 0; i < found->at.kind; ++i)
            vertices[i + 1] = found->corners[i], coefficients[i + 1] = -found->at.share[i];
        if (found->weight)
            emit(d, out, found->at.kind + 1, vertices, coefficients, found->at.gap, found->weight * s->areas[p]);
    }
}

/* Symmetric 12 x 12 (8 x 8) matrices over four vertices: blocks on or right of the diagonal, row by row. */
typedef double blocks_t[10][9];

/* Adds scale (u v' + v u') / 2. */
INLINE void add_product(int d, double scale, const double *u, const double *v, blocks_t H)
{
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int p = 0; p < d; ++p)
                for (int q = 0; q < d; ++q)
                    H[n][d * p + q] += 0.5 * scale * (u[d * i + p] * v[d * j + q] + v[d * i + p] * u[d * j + q]);
}

INLINE void outer(int d, const double *c, const double *v, double *out)
{
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < d; ++j)
            out[d * i + j] = c[i] * v[j];
}

/* The gap's rotation. Its vector g = sum c_i x_i over closest points that depend on `parameters` numbers; `b` has the derivatives of the
 * coefficients by them. Gives for each, after they have been made orthonormal, u = c t (t its tangent) and v = b g: with their parameters
 * eliminated, (g^2)'' = 2 c_i c_j I - 2 sum (u + v)(u + v)'. Tangents (d each) go to `t`. */
INLINE void rotation(int d, int parameters, const double *c, double (*b)[4], const double *const *x, const double *gap, double (*t)[3],
                     double (*u)[12], double (*v)[12])
{
    for (int e = 0; e < parameters; ++e) {
        for (int j = 0; j < d; ++j) {
            t[e][j] = 0.0;
            for (int i = 0; i < 4; ++i)
                t[e][j] += b[e][i] * x[i][j];
        }
        if (e == 1) {
            const double along = dot(d, t[1], t[0]);
            for (int j = 0; j < d; ++j)
                t[1][j] -= along * t[0][j];
            for (int i = 0; i < 4; ++i)
                b[1][i] -= along * b[0][i];
        }
        const double size = sqrt(dot(d, t[e], t[e]));
        for (int j = 0; j < d; ++j)
            t[e][j] /= size;
        for (int i = 0; i < 4; ++i)
            b[e][i] /= size;
        outer(d, c, t[e], u[e]), outer(d, b[e], gap, v[e]);
    }
}

/* Adds scale times the Hessian of the squared gap. */
INLINE void add_distance(int d, double scale, int parameters, const double *c, double (*b)[4], const double *const *x, const double *gap,
                         blocks_t H)
{
    double t[2][3], u[2][12], v[2][12];
    rotation(d, parameters, c, b, x, gap, t, u, v);
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int p = 0; p < d; ++p)
                H[n][(d + 1) * p] += 2.0 * scale * c[i] * c[j];
    for (int e = 0; e < parameters; ++e) {
        for (int q = 0; q < 4 * d; ++q)
            u[e][q] += v[e][q];
        add_product(d, -2.0 * scale, u[e], u[e], H);
    }
}

/* Derivatives of the coefficients of two edges' closest points by the shares along them. */
#define OF_EDGES {{-1.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, -1.0}}

/* From zero at t = 0 to one at t = 1 and beyond; F, F' and F''. */
INLINE void fade(double t, double *F)
{
    F[0] = t < 1.0 ? (2.0 - t) * t : 1.0, F[1] = t < 1.0 ? 2.0 - 2.0 * t : 0.0, F[2] = t < 1.0 ? -2.0 : 0.0;
}

/* The contact of two edges that cross. It fades where they are nearly parallel, and where an end of one is nearly as close to the other edge as the
 * closest points are: there the end's own contact takes over. The weight's derivatives are found where it fades. */
INLINE void edge_contact(const surface_t *s, const double *x, double reach, int32_t one, int32_t other, contacts_t *out)
{
    const int32_t v[4] = {s->edge[2 * (int64_t)one], s->edge[2 * (int64_t)one + 1], s->edge[2 * (int64_t)other], s->edge[2 * (int64_t)other + 1]};
    const double *at[4];
    for (int i = 0; i < 4; ++i)
        at[i] = x + 3 * (int64_t)v[i];
    double a[3], b[3], w[3], gap[3];
    minus(3, at[1], at[0], a), minus(3, at[3], at[2], b), minus(3, at[2], at[0], w);
    const double aa = dot(3, a, a), ab = dot(3, a, b), bb = dot(3, b, b), aw = dot(3, a, w), bw = dot(3, b, w), det = aa * bb - ab * ab;
    const double s0 = aw * bb - bw * ab, t0 = ab * aw - aa * bw;
    if (!(s0 > 0.0 && t0 > 0.0 && s0 < det && t0 < det))
        return;
    const double c[4] = {1.0 - s0 / det, s0 / det, t0 / det - 1.0, -t0 / det};
    for (int j = 0; j < 3; ++j)
        gap[j] = c[0] * at[0][j] + c[1] * at[1][j] + c[2] * at[2][j] + c[3] * at[3][j];
    const double D = dot(3, gap, gap);
    if (!(D < reach))
        return;
    closest_t ends[4];
    double F[5][3], ratios[4], weight = fmin(s->edge_areas[one], s->edge_areas[other]);
    const double sine = det / (aa * bb);
    fade(sine / PARALLEL, F[4]);
    weight *= F[4][0];
    for (int i = 0; i < 4; ++i) {
        const int k = i < 2 ? 2 : 0;
        ratios[i] = to_edge(3, at[i], at[k], at[k + 1], ends + i) / D;
        fade(fmax(ratios[i] - 1.0, 0.0), F[i]);
        weight *= F[i][0];
    }
    if (!(weight > 0.0))
        return;
    const int fades = F[0][1] + F[1][1] + F[2][1] + F[3][1] + F[4][1] > 0.0;
    if (fades && out->count < out->capacity && out->faded < out->fades_capacity) {
        double rates[5][12] = {{0.0}}, of_gap[12], *gradient = out->fades + 12 * out->faded;
        double(*H)[9] = (double(*)[9])(out->curves + 90 * out->faded);
        memset(gradient, 0, 12 * sizeof(double)), memset(H, 0, 90 * sizeof(double));
        out->fading[out->faded] = out->count;
        outer(3, c, gap, of_gap); /* half of D' */
        for (int i = 0; i < 4; ++i) {
            if (F[i][1] == 0.0)
                continue;
            const int k = i < 2 ? 2 : 0;
            double e[4] = {0.0}, of_end[12], slide[1][4] = {{0.0}}, edges[2][4] = OF_EDGES;
            e[i] = 1.0;
            for (int q = 0; q < ends[i].kind; ++q)
                e[k + ends[i].corner[q]] = -ends[i].share[q];
            slide[0][k] = 1.0, slide[0][k + 1] = -1.0;
            outer(3, e, ends[i].gap, of_end);
            const double share = weight * F[i][1] / F[i][0] / D;
            add_distance(3, share, ends[i].kind - 1, e, slide, at, ends[i].gap, H);
            add_distance(3, -share * ratios[i], 2, c, edges, at, gap, H);
            add_product(3, -8.0 * share / D, of_end, of_gap, H);
            add_product(3, 8.0 * share * ratios[i] / D, of_gap, of_gap, H);
            for (int q = 0; q < 12; ++q)
                rates[i][q] = 2.0 * (of_end[q] - ratios[i] * of_gap[q]) / D;
        }
        if (F[4][1] > 0.0) { /* of 1 - C, C the squared cosine */
            const double C = ab * ab / (aa * bb), share = -C * weight * F[4][1] / F[4][0] / PARALLEL;
            double of_a[3], of_b[3];
            for (int j = 0; j < 3; ++j)
                of_a[j] = 2.0 * (b[j] / ab - a[j] / aa), of_b[j] = 2.0 * (a[j] / ab - b[j] / bb);
            for (int i = 0, n = 0; i < 4; ++i)
                for (int k = i; k < 4; ++k, ++n)
                    for (int p = 0; p < 3; ++p)
                        for (int q = 0; q < 3; ++q) {
                            const double same = p == q;
                            const double h = k < 2   ? of_a[p] * of_a[q] + 4.0 * a[p] * a[q] / (aa * aa) - 2.0 * same / aa - 2.0 * b[p] * b[q] / (ab * ab)
                                             : i < 2 ? of_a[p] * of_b[q] + 2.0 * same / ab - 2.0 * b[p] * a[q] / (ab * ab)
                                                     : of_b[p] * of_b[q] + 4.0 * b[p] * b[q] / (bb * bb) - 2.0 * same / bb - 2.0 * a[p] * a[q] / (ab * ab);
                            H[n][3 * p + q] += ((i + k) % 2 ? -share : share) * h;
                        }
            for (int j = 0; j < 3; ++j) {
                rates[4][3 + j] = -C * of_a[j] / PARALLEL, rates[4][9 + j] = -C * of_b[j] / PARALLEL;
                rates[4][j] = -rates[4][3 + j], rates[4][6 + j] = -rates[4][9 + j];
            }
        }
        for (int i = 0; i < 5; ++i) {
            for (int k = 0; k <= i; ++k)
                add_product(3, k < i ? 2.0 * weight * F[i][1] / F[i][0] * F[k][1] / F[k][0] : weight * F[i][2] / F[i][0], rates[i], rates[k], H);
            for (int q = 0; q < 12; ++q)
                gradient[q] += weight * F[i][1] / F[i][0] * rates[i][q];
        }
    }
    out->faded += fades;
    emit(3, out, 4, v, c, gap, weight);
}

/* The contacts nearer than dhat among candidate pairs: `points` (vertex and facet; a vertex's pairs stand together) and `edges`. Of contacts and of
 * those with weights that depend on positions, no more than `capacities` are written; counts says how many there are. Returns 1 without memory. */
int active_pairs(const surface_t *s, const double *x, double dhat, int64_t n_points, const int32_t *points, int64_t n_edges, const int32_t *edges,
                 const int64_t *capacities, int32_t *vertices, double *coefficients, double *gaps, double *weights, int64_t *fading, double *fades,
                 double *curves, int64_t *counts)
{
    const int64_t size = s->vertices + s->edges + s->facets;
    const double reach = dhat * dhat;
    contacts_t out = {0, capacities[0], 0, capacities[1], vertices, coefficients, gaps, weights, fades, curves, fading};
    int64_t most = 0;
    for (int64_t k = 0, first = 0; k < n_points; ++k) {
        first = k && points[2 * k] == points[2 * k - 2] ? first : k;
        most = most > k - first + 1 ? most : k - first + 1;
    }
    int32_t *memory = calloc(n_points ? 3 * size : 1, sizeof(int32_t));
    nearest_t *nearest = malloc((7 * most + 1) * sizeof(nearest_t));
    if (!memory || !nearest) {
        free(memory), free(nearest);
        return 1;
    }
    scratch_t scratch = {memory, memory + size, nearest};
    for (int64_t k = 0, end; k < n_points; k = end) {
        for (end = k + 1; end < n_points && points[2 * end] == points[2 * k];)
            ++end;
        if (s->d == 3)
            point_contacts(3, s, x, reach, points[2 * k], end - k, points + 2 * k, (int32_t)(k + 1), memory + 2 * size, &scratch, &out);
        else
            point_contacts(2, s, x, reach, points[2 * k], end - k, points + 2 * k, (int32_t)(k + 1), memory + 2 * size, &scratch, &out);
    }
    for (int64_t k = 0; k < n_edges; ++k)
        edge_contact(s, x, reach, edges[2 * k], edges[2 * k + 1], &out);
    free(memory), free(nearest);
    counts[0] = out.count, counts[1] = out.faded;
    return 0;
}

/* The barrier's law kappa dhat g(s), g(s) = -(s - 1)^2 ln s, s = (gap / dhat)^2, and its first two derivatives by gap^2. */
INLINE double law(double squared, double dhat, double kappa, double *slope, double *second)
{
    const double s = squared / (dhat * dhat);
    *slope = *second = 0.0;
    if (s >= 1.0)
        return 0.0;
    const double logarithm = log(s), rest = s - 1.0;
    *slope = -kappa / dhat * rest * (2.0 * logarithm + rest / s);
    *second = -kappa / (dhat * dhat * dhat) * (2.0 * logarithm + 4.0 * rest / s - rest * rest / (s * s));
    return -kappa * dhat * rest * rest * logarithm;
}

/* The sum of weights times the law, and its gradient by the vertices (n, d), added to `gradient`. */
double barrier_sum(int d, int64_t count, const int32_t *vertices, const double *coefficients, const double *gaps, const double *weights,
                   int64_t faded, const int64_t *fading, const double *fades, double dhat, double kappa, double *gradient)
{
    double total = 0.0, slope, second;
    for (int64_t k = 0; k < count; ++k) {
        total += weights[k] * law(dot(d, gaps + d * k, gaps + d * k), dhat, kappa, &slope, &second);
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * vertices[4 * k + i] + j] += 2.0 * weights[k] * slope * coefficients[4 * k + i] * gaps[d * k + j];
    }
    for (int64_t f = 0; f < faded; ++f) {
        const int64_t k = fading[f];
        const double energy = law(dot(d, gaps + d * k, gaps + d * k), dhat, kappa, &slope, &second);
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * vertices[4 * k + i] + j] += energy * fades[12 * f + 3 * i + j];
    }
    return total;
}

/* Blocks c_i c_j T of contacts with symmetric tensors T (count, d, d), of vertices that have rows (`rows`, -1: none), on or right of the diagonal.
 * Returns how many: up to 10 count. */
int64_t tensor_blocks(int d, int64_t count, const int32_t *vertices, const double *coefficients, const double *tensors, const int64_t *rows,
                      int64_t *out_rows, int64_t *out_columns, double *blocks)
{
    int64_t n = 0;
    for (int64_t k = 0; k < count; ++k) {
        const double *c = coefficients + 4 * k, *T = tensors + d * d * k;
        double trace = 0.0;
        for (int p = 0; p < d; ++p)
            trace += T[(d + 1) * p];
        for (int i = 0; i < 4; ++i)
            for (int j = i; j < 4; ++j) {
                const int64_t a = rows[vertices[4 * k + i]], b = rows[vertices[4 * k + j]];
                if (c[i] * c[j] * trace == 0.0 || a < 0 || b < 0)
                    continue;
                out_rows[n] = a < b ? a : b, out_columns[n] = a < b ? b : a;
                for (int p = 0; p < d * d; ++p)
                    blocks[d * d * n + p] = c[i] * c[j] * T[p];
                ++n;
            }
    }
    return n;
}

/* The Hessian over a contact's vertices of its weight times the law, or (`convex`) its convex part: the curvature along the gap and across it, where
 * they are positive, and of each parameter's u v' + v u' + v v' (`rotation`) one of two eigenvalues. */
INLINE void contact_hessian(int d, const double *c, const double *const *x, const double *gap, double weight, double dhat, double kappa, int convex,
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
        add_product(d, along, vector, vector, H);
    if (parameters + 1 < d && (slope > 0.0 || !convex)) { /* normals beside the gap's own */
        double n[2][3];
        if (d == 2)
            n[0][0] = -gap[1], n[0][1] = gap[0];
        else {
            const int least = fabs(gap[0]) < fabs(gap[1]) ? (fabs(gap[0]) < fabs(gap[2]) ? 0 : 2) : (fabs(gap[1]) < fabs(gap[2]) ? 1 : 2);
            const double any[3] = {least == 0, least == 1, least == 2}, *a = parameters ? t[0] : any;
            cross(gap, a, n[0]), cross(gap, n[0], n[1]);
        }
        for (int e = 0; e < d - 1 - parameters; ++e) {
            outer(d, c, n[e], vector);
            add_product(d, slope / dot(d, n[e], n[e]), vector, vector, H);
        }
    }
    for (int e = 0; e < parameters; ++e) {
        double uu = 0.0, vv = 0.0;
        for (int q = 0; q < 4 * d; ++q)
            uu += u[e][q] * u[e][q], vv += v[e][q] * v[e][q];
        const double root = sqrt(vv * vv + 4.0 * uu * vv);
        for (int side = -1; side < 2; side += 2) {
            const double value = 0.5 * (vv + side * root), size = -slope * value;
            if (size < 0.0 && convex)
                continue;
            for (int q = 0; q < 4 * d; ++q)
                vector[q] = vv * u[e][q] + value * v[e][q];
            add_product(d, size / (uu * vv * vv + value * value * vv), vector, vector, H);
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

/* Blocks of the convex part of the Hessian of `factor` times the sum of weights times the law, as tensor_blocks has them. */
int64_t barrier_blocks(int d, int64_t count, const int32_t *vertices, const double *coefficients, const double *gaps, const double *weights,
                       const double *x, int64_t faded, const int64_t *fading, const double *fades, const double *curves, double dhat,
                       double kappa, double factor, int convex, const int64_t *rows, int64_t *out_rows, int64_t *out_columns, double *blocks)
{
    int64_t n = 0;
    for (int64_t k = 0, f = 0; k < count; ++k) {
        blocks_t H = {{0.0}};
        const int32_t *v = vertices + 4 * k;
        const double *c = coefficients + 4 * k, *gap = gaps + d * k, *at[4];
        const int fade = f < faded && fading[f] == k;
        for (int i = 0; i < 4; ++i)
            at[i] = x + (int64_t)d * v[i];
        if (d == 3)
            contact_hessian(3, c, at, gap, factor * weights[k], dhat, kappa, convex && !fade, H);
        else
            contact_hessian(2, c, at, gap, factor * weights[k], dhat, kappa, convex, H);
        if (fade) {
            double slope, second, force[12];
            const double energy = factor * law(dot(3, gap, gap), dhat, kappa, &slope, &second);
            for (int q = 0; q < 90; ++q)
                H[q / 9][q % 9] += energy * curves[90 * f + q];
            outer(3, c, gap, force);
            add_product(3, 4.0 * factor * slope, force, fades + 12 * f, H);
            if (convex)
                clamp_matrix(H);
            ++f;
        }
        for (int i = 0, m = 0; i < 4; ++i)
            for (int j = i; j < 4; ++j, ++m) {
                const int64_t a = rows[v[i]], b = rows[v[j]];
                if (a < 0 || b < 0 || c[i] * c[j] == 0.0)
                    continue;
                out_rows[n] = a < b ? a : b, out_columns[n] = a < b ? b : a;
                for (int p = 0; p < d; ++p)
                    for (int q = 0; q < d; ++q)
                        blocks[d * d * n + d * p + q] = H[m][a < b ? d * p + q : d * q + p];
                ++n;
            }
    }
    return n;
}
