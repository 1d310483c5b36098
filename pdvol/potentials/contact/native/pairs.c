/* The active pairs of a contact surface, and sums over them. */
#include "surface.h"

#ifndef FADE
#define FADE 1.0
#endif
#ifndef PARALLEL
#define PARALLEL 1e-3
#endif

/* One contact: up to four vertices and their coefficients in its gap vector, and its weight. */
typedef struct {
    int64_t count, capacity, faded, fades_capacity;
    int32_t *vertices;
    double *coefficients, *gaps, *weights, *fades; /* fades (faded, 12): derivative of the weight by the vertices */
    double *bends;                                 /* (faded, 5, 12): their squares are the convex part of the weight's Hessian */
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

/* From zero at t = 0 to one at t = 1 and beyond, with its derivative. */
INLINE double fade(double t, double *slope)
{
    *slope = t < 1.0 ? 2.0 - 2.0 * t : 0.0;
    return t < 1.0 ? (2.0 - t) * t : 1.0;
}

/* The contact of two edges that cross: it fades where they are nearly parallel, and where their closest points come within dhat of an end, for
 * there the end's own contact takes over. */
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
    const double distance = dot(3, gap, gap);
    if (!(distance < reach))
        return;
    double factors[5], slopes[5], rates[5][12] = {{0.0}}, bends[5][12] = {{0.0}}, product = 1.0;
    const double sine = det / (aa * bb);
    factors[4] = fade(sine / PARALLEL, slopes + 4);
    for (int i = 0; i < 4; ++i) { /* in the plane of both edges, from an end to the other edge */
        closest_t end;
        const int k = i < 2 ? 2 : 0;
        const double beyond = to_edge(3, at[i], at[k], at[k + 1], &end) - distance;
        factors[i] = fade(fmax(beyond, 0.0) / (FADE * FADE * reach), slopes + i);
        product *= factors[i];
        if (slopes[i] == 0.0)
            continue;
        const double up = dot(3, end.gap, gap) / distance;
        const double size = dot(3, end.gap, end.gap) - up * up * distance, scale = sqrt(2.0 * slopes[i] / (FADE * FADE * reach * fmax(size, 1e-300)));
        for (int j = 0; j < 3; ++j) {
            const double across = scale * (end.gap[j] - up * gap[j]);
            bends[i][3 * i + j] = across;
            for (int q = 0; q < end.kind; ++q)
                bends[i][3 * (k + end.corner[q]) + j] = -end.share[q] * across;
        }
        for (int j = 0; j < 3; ++j) {
            rates[i][3 * i + j] += 2.0 * end.gap[j] / (FADE * FADE * reach);
            for (int q = 0; q < end.kind; ++q)
                rates[i][3 * (k + end.corner[q]) + j] -= 2.0 * end.share[q] * end.gap[j] / (FADE * FADE * reach);
            for (int q = 0; q < 4; ++q)
                rates[i][3 * q + j] -= 2.0 * c[q] * gap[j] / (FADE * FADE * reach);
        }
    }
    product *= factors[4];
    if (!(product > 0.0))
        return;
    const double area = fmin(s->widths[one], s->widths[other]);
    if (product < 1.0) {
        if (slopes[4] > 0.0)
            for (int j = 0; j < 3; ++j) {
                const double by_a = 2.0 * ((bb * a[j] - ab * b[j]) / (aa * bb) - sine * a[j] / aa) / PARALLEL;
                const double by_b = 2.0 * ((aa * b[j] - ab * a[j]) / (aa * bb) - sine * b[j] / bb) / PARALLEL;
                rates[4][j] = -by_a, rates[4][3 + j] = by_a, rates[4][6 + j] = -by_b, rates[4][9 + j] = by_b;
                for (int q = 0; q < 4; ++q) /* of the angle itself, of which the sine is nearly the size */
                    bends[4][3 * q + j] = rates[4][3 * q + j] * sqrt(0.5 * PARALLEL * slopes[4] / sine);
            }
        if (out->count < out->capacity && out->faded < out->fades_capacity) {
            double *fades = out->fades + 12 * out->faded;
            memset(fades, 0, 12 * sizeof(double));
            for (int i = 0; i < 5; ++i)
                for (int q = 0; q < 12; ++q)
                    fades[q] += area * product / factors[i] * slopes[i] * rates[i][q];
            out->fading[out->faded] = out->count;
            for (int i = 0; i < 5; ++i)
                for (int q = 0; q < 12; ++q)
                    out->bends[60 * out->faded + 12 * i + q] = bends[i][q] * sqrt(area * product / factors[i]);
        }
        ++out->faded;
    }
    emit(3, out, 4, v, c, gap, area * product);
}

/* The contacts nearer than dhat among candidate pairs: `points` (vertex and facet; a vertex's pairs stand together) and `edges`. Of contacts and of
 * those with weights that depend on positions, no more than `capacities` are written; counts says how many there are. Returns 1 without memory. */
int active_pairs(const surface_t *s, const double *x, double dhat, int64_t n_points, const int32_t *points, int64_t n_edges, const int32_t *edges,
                 const int64_t *capacities, int32_t *vertices, double *coefficients, double *gaps, double *weights, int64_t *fading, double *fades,
                 double *bends, int64_t *counts)
{
    const int64_t size = s->vertices + s->edges + s->facets;
    const double reach = dhat * dhat;
    contacts_t out = {0, capacities[0], 0, capacities[1], vertices, coefficients, gaps, weights, fades, bends, fading};
    int64_t most = 0;
    for (int64_t k = 0, first = 0; k < n_points; ++k) {
        first = k && points[2 * k] == points[2 * k - 2] ? first : k;
        most = most > k - first + 1 ? most : k - first + 1;
    }
    int32_t *memory = calloc(3 * size, sizeof(int32_t));
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

/* The barrier's law kappa dhat g(s), g(s) = -(s - 1)^2 ln s, s = (gap / dhat)^2, and its derivative by gap^2. */
INLINE double law(double squared, double dhat, double kappa, double *slope)
{
    const double s = squared / (dhat * dhat);
    if (s >= 1.0) {
        *slope = 0.0;
        return 0.0;
    }
    const double logarithm = log(s);
    *slope = -kappa / dhat * (s - 1.0) * (2.0 * logarithm + (s - 1.0) / s);
    return -kappa * dhat * (s - 1.0) * (s - 1.0) * logarithm;
}

/* The sum of weights times the law, and its gradient by the vertices (n, d), added to `gradient`. */
double barrier_sum(int d, int64_t count, const int32_t *vertices, const double *coefficients, const double *gaps, const double *weights,
                   int64_t faded, const int64_t *fading, const double *fades, double dhat, double kappa, double *gradient)
{
    double total = 0.0, slope;
    for (int64_t k = 0; k < count; ++k) {
        total += weights[k] * law(dot(d, gaps + d * k, gaps + d * k), dhat, kappa, &slope);
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * vertices[4 * k + i] + j] += 2.0 * weights[k] * slope * coefficients[4 * k + i] * gaps[d * k + j];
    }
    for (int64_t f = 0; f < faded; ++f) {
        const int64_t k = fading[f];
        const double energy = law(dot(d, gaps + d * k, gaps + d * k), dhat, kappa, &slope);
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * vertices[4 * k + i] + j] += energy * fades[12 * f + 3 * i + j];
    }
    return total;
}

/* Blocks of the sum of squares v v' of vectors (count, 4, d) over four vertices each that have rows (`rows`, -1: none), on or right of the
 * diagonal. Returns how many: up to 10 count. */
int64_t square_blocks(int d, int64_t count, const int32_t *vertices, const double *vectors, const int64_t *rows, int64_t *out_rows,
                      int64_t *out_columns, double *blocks)
{
    int64_t n = 0;
    for (int64_t k = 0; k < count; ++k) {
        double sizes[4];
        for (int i = 0; i < 4; ++i)
            sizes[i] = dot(d, vectors + d * (4 * k + i), vectors + d * (4 * k + i));
        for (int i = 0; i < 4; ++i)
            for (int j = i; j < 4; ++j) {
                const int64_t a = rows[vertices[4 * k + i]], b = rows[vertices[4 * k + j]];
                if (sizes[i] * sizes[j] == 0.0 || a < 0 || b < 0)
                    continue;
                const double *u = vectors + d * (4 * k + (a < b ? i : j)), *v = vectors + d * (4 * k + (a < b ? j : i));
                out_rows[n] = a < b ? a : b, out_columns[n] = a < b ? b : a;
                for (int p = 0; p < d; ++p)
                    for (int q = 0; q < d; ++q)
                        blocks[d * d * n + d * p + q] = u[p] * v[q];
                ++n;
            }
    }
    return n;
}

/* Adds scale v v' to the blocks H of a contact, on or right of the diagonal. */
INLINE void add_square(int d, double scale, const double *v, double (*H)[9])
{
    for (int i = 0, n = 0; i < 4; ++i)
        for (int j = i; j < 4; ++j, ++n)
            for (int p = 0; p < d; ++p)
                for (int q = 0; q < d; ++q)
                    H[n][d * p + q] += scale * v[d * i + p] * v[d * j + q];
}

/* Adds a b' + b a', or its convex part. */
INLINE void add_product(const double *a, const double *b, int convex, double (*H)[9])
{
    double aa = 0.0, ab = 0.0, bb = 0.0, vector[12];
    for (int q = 0; q < 12; ++q)
        aa += a[q] * a[q], ab += a[q] * b[q], bb += b[q] * b[q];
    if (!(aa * bb > 0.0))
        return;
    for (int side = convex ? 1 : -1; side < 2; side += 2) {
        const double ratio = side * sqrt(aa / bb), value = ab + side * sqrt(aa * bb), size = aa + 2.0 * ratio * ab + ratio * ratio * bb;
        for (int q = 0; q < 12; ++q)
            vector[q] = a[q] + ratio * b[q];
        if (size > 0.0)
            add_square(3, value / size, vector, H);
    }
}

INLINE void outer(int d, const double *c, const double *v, double scale, double *out)
{
    for (int i = 0; i < 4; ++i)
        for (int j = 0; j < d; ++j)
            out[d * i + j] = scale * c[i] * v[j];
}

/* The convex part of one contact's Hessian: weight times the law. Its curvature along the gap counts where the weight is positive, and the one
 * across the gap where it is negative. To these comes what the gap's rotation adds: with the closest points' parameters eliminated, and tangents t
 * and derivatives b of the coefficients by them orthonormal, (gap^2)'' = 2 sum over the normals n of (c n)(c n)' - 2 sum over the tangents of
 * u v' + v u' + v v', u = c t, v = b gap. */
INLINE void contact_hessian(int d, const double *c, const int32_t *vertices, const double *x, const double *gap, double weight, double dhat,
                            double kappa, int convex, double (*H)[9])
{
    double slope, t[2][3], b[2][4] = {{0.0}}, vector[12], u[12], v[12];
    const double squared = dot(d, gap, gap), s = squared / (dhat * dhat);
    law(squared, dhat, kappa, &slope);
    slope *= 2.0 * weight;
    const int edges = c[0] > 0.0 && c[1] > 0.0, corners = (c[1] != 0.0) + (c[2] != 0.0) + (c[3] != 0.0);
    const int parameters = edges ? 2 : corners - 1;
    for (int e = 0; e < parameters; ++e) {
        const int from = edges ? 3 * e : 1, to = edges ? 1 + e : 2 + e; /* the coefficient of `from` falls */
        const double sign = edges && e == 0 ? 1.0 : edges ? 1.0 : -1.0;
        b[e][from] = -sign, b[e][to] = sign;
        minus(d, x + (int64_t)d * vertices[to], x + (int64_t)d * vertices[from], t[e]);
        for (int j = 0; j < d; ++j)
            t[e][j] *= sign;
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
    }
    const double second = -(2.0 * log(s) + 4.0 * (s - 1.0) / s - (s - 1.0) * (s - 1.0) / (s * s)) * kappa / (dhat * dhat * dhat);
    const double along = 4.0 * weight * second + slope / squared;
    outer(d, c, gap, 1.0, vector);
    if (along > 0.0 || !convex)
        add_square(d, along, vector, H);
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
            outer(d, c, n[e], 1.0, vector);
            add_square(d, slope / dot(d, n[e], n[e]), vector, H);
        }
    }
    for (int e = 0; e < parameters; ++e) {
        outer(d, c, t[e], 1.0, u), outer(d, b[e], gap, 1.0, v);
        const double uu = dot(2, c, c) + dot(2, c + 2, c + 2), vv = squared * (dot(2, b[e], b[e]) + dot(2, b[e] + 2, b[e] + 2));
        const double root = sqrt(vv * vv + 4.0 * uu * vv);
        for (int side = -1; side < 2; side += 2) { /* the two eigenvalues of what is subtracted */
            const double value = 0.5 * (vv + side * root), size = -slope * value;
            if (size < 0.0 && convex)
                continue;
            for (int q = 0; q < 4 * d; ++q)
                vector[q] = vv * u[q] + value * v[q];
            add_square(d, size / (uu * vv * vv + value * value * vv), vector, H);
        }
    }
}

/* Blocks of the convex part of the Hessian of `factor` times the sum of weights times the law, as square_blocks has them. */
int64_t barrier_blocks(int d, int64_t count, const int32_t *vertices, const double *coefficients, const double *gaps, const double *weights,
                       const double *x, int64_t faded, const int64_t *fading, const double *fades, const double *bends, double dhat,
                       double kappa, double factor,
                       int convex, const int64_t *rows, int64_t *out_rows, int64_t *out_columns, double *blocks)
{
    int64_t n = 0;
    double slope;
    for (int64_t k = 0, f = 0; k < count; ++k) {
        double H[10][9] = {{0.0}};
        const int32_t *v = vertices + 4 * k;
        const double *gap = gaps + d * k;
        if (d == 3)
            contact_hessian(3, coefficients + 4 * k, v, x, gap, factor * weights[k], dhat, kappa, convex, H);
        else
            contact_hessian(2, coefficients + 4 * k, v, x, gap, factor * weights[k], dhat, kappa, convex, H);
        if (f < faded && fading[f] == k) {
            const double size = factor * law(dot(3, gap, gap), dhat, kappa, &slope);
            double force[12];
            for (int e = 0; e < 5; ++e)
                add_square(3, size, bends + 60 * f + 12 * e, H);
            outer(3, coefficients + 4 * k, gap, 2.0 * factor * slope, force);
            add_product(force, fades + 12 * f, convex, H);
            ++f;
        }
        for (int i = 0, m = 0; i < 4; ++i)
            for (int j = i; j < 4; ++j, ++m) {
                const int64_t a = rows[v[i]], b = rows[v[j]];
                if (a < 0 || b < 0 || coefficients[4 * k + i] * coefficients[4 * k + j] == 0.0)
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
