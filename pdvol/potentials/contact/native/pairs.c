/* The active pairs of a contact surface, and sums over them. */
#include "surface.h"

/* sin^2 of the angle between edges below which their contact fades: the pair's normal is lost there (Li et al. 2020, section 4.2) */
#define PARALLEL 1e-3

/* What a point has been seen to be nearest to: a vertex, an edge or a facet, and how often unions count it. */
typedef struct {
    int32_t weight;
    closest_t at;
    int32_t corners[3];
} nearest_t;

/* Contacts being found, and how many there is room for. */
typedef struct {
    contacts_t to;
    int64_t capacity, fades_capacity;
} found_t;

INLINE void emit(int d, found_t *found, int n, const int32_t *vertices, const double *coefficients, const double *gap, double weight)
{
    contacts_t *out = &found->to;
    const int64_t k = out->count++;
    if (k >= found->capacity)
        return;
    for (int i = 0; i < 4; ++i) {
        out->vertices[4 * k + i] = vertices[i < n ? i : 0];
        out->coefficients[4 * k + i] = i < n ? coefficients[i] : 0.0;
    }
    for (int j = 0; j < d; ++j)
        out->gaps[d * k + j] = gap[j];
    out->weights[k] = weight;
}

/* Scratch memory of one call: when each vertex, edge and facet was met last, where its sum is, and when it was counted last. */
typedef struct {
    int32_t *met, *slot, *counted; /* (vertices + edges + facets) each */
    nearest_t *nearest;
    int64_t room; /* of `nearest` */
    int32_t stamp;
} scratch_t;

/* Adds `weight` to the sum of the primitive that the corners name (`key`), or begins one. */
INLINE void add(scratch_t *scratch, int64_t key, int32_t *count, int32_t weight, const closest_t *at, const int32_t *corners)
{
    if (scratch->met[key] != scratch->stamp) {
        scratch->met[key] = scratch->stamp, scratch->slot[key] = (*count)++;
        nearest_t *fresh = scratch->nearest + scratch->slot[key];
        fresh->weight = 0, fresh->at = *at;
        for (int i = 0; i < at->kind; ++i)
            fresh->corners[i] = corners[at->corner[i]];
    }
    scratch->nearest[scratch->slot[key]].weight += weight;
}

/* Contacts of one point with the facets near it, the pairs from `first` to before `end`: the union of the facets counts once where they share edges and vertices (inclusion and exclusion). */
INLINE void point_contacts(int d, const surface_t *s, const double *x, double dhat, const pairs_t *all, int64_t first, int64_t end,
                           scratch_t *scratch, found_t *out)
{
    const int32_t p = all->points[2 * first], stamp = ++scratch->stamp;
    const double reach = dhat * dhat, bounded = (1.0 + BOUND_MARGIN) * dhat;
    int32_t count = 0, *counted = scratch->counted;
    const double *point = x + (int64_t)d * p;
    for (int64_t k = first; k < end; ++k) {
        if (left(all, all->point_bounds[k], all->point_rates[k]) > bounded)
            continue;
        const int64_t f = all->points[2 * k + 1];
        const int32_t *facet = s->facet + d * f;
        const double *corners[3] = {x + (int64_t)d * facet[0], x + (int64_t)d * facet[1], d == 3 ? x + (int64_t)d * facet[2] : 0};
        closest_t at;
        if (!(to_facet(d, point, corners, &at) < reach))
            continue;
        const int64_t key = at.kind == 1   ? facet[at.corner[0]]
                            : at.kind == d ? s->vertices + s->edges + f
                                           : s->vertices + s->facet_edges[3 * f + at.corner[0]];
        add(scratch, key, &count, 1, &at, facet);
        for (int i = 0; d == 3 && i < 3; ++i) {
            const int64_t e = s->facet_edges[3 * f + i];
            if (!s->edge_share[e] || counted[s->vertices + e] == stamp)
                continue;
            counted[s->vertices + e] = stamp;
            const int32_t *edge = s->edge + 2 * e;
            if (to_edge(3, point, x + 3 * (int64_t)edge[0], x + 3 * (int64_t)edge[1], &at) < reach)
                add(scratch, at.kind == 1 ? edge[at.corner[0]] : s->vertices + e, &count, s->edge_share[e], &at, edge);
        }
        for (int i = 0; i < d; ++i) {
            const int32_t v = facet[i];
            if (!s->vertex_share[v] || counted[v] == stamp)
                continue;
            counted[v] = stamp;
            at.kind = 1, at.corner[0] = 0, at.share[0] = 1.0;
            minus(d, point, corners[i], at.gap);
            if (dot(d, at.gap, at.gap) < reach)
                add(scratch, v, &count, s->vertex_share[v], &at, &v);
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

/* Adds scale u u', over the first n vertices alone. */
INLINE void add_square(int d, int n, double scale, const double *u, blocks_t H)
{
    for (int i = 0, row = 0; i < n; row += 4 - i++)
        for (int j = i; j < n; ++j)
            for (int p = 0; p < d; ++p)
                for (int q = 0; q < d; ++q)
                    H[row + j - i][d * p + q] += scale * (u[d * i + p] * u[d * j + q]);
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
        add_square(d, 4, -2.0 * scale, u[e], H);
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
INLINE void edge_contact(const surface_t *s, const double *x, double dhat, int32_t one, int32_t other, found_t *found)
{
    contacts_t *out = &found->to;
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
    if (!(D < dhat * dhat))
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
    if (fades && out->count < found->capacity && out->faded < found->fades_capacity) {
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
            add_square(3, 4, 8.0 * share * ratios[i] / D, of_gap, H);
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
    emit(3, found, 4, v, c, gap, weight);
}

/* The contacts of all vertices of a list. Returns 1 without memory. */
INLINE int all_point_contacts(int d, const surface_t *s, const double *x, double dhat, const pairs_t *pairs, scratch_t *scratch, found_t *out)
{
    const int32_t *points = pairs->points;
    for (int64_t k = 0, end; k < pairs->n_points; k = end) {
        for (end = k + 1; end < pairs->n_points && points[2 * end] == points[2 * k];)
            ++end;
        if (7 * (end - k) > scratch->room) {
            scratch->room = 14 * (end - k);
            free(scratch->nearest);
            if (!(scratch->nearest = malloc(scratch->room * sizeof(nearest_t))))
                return 1;
        }
        point_contacts(d, s, x, dhat, pairs, k, end, scratch, out);
    }
    return 0;
}

/* The contacts nearer than dhat among the candidates of n lists: first those of points, list by list, and then those of edges. `to` has room for so
 * many as it counts; of others nothing is written. counts (2 n, 2): how many contacts there are after each of these parts, and how many of them have
 * weights that depend on positions. Returns 1 without memory. */
int active_pairs(const surface_t *s, const double *x, double dhat, int n, pairs_t *const *lists, const contacts_t *to, int64_t *counts)
{
    const int64_t size = s->vertices + s->edges + s->facets;
    found_t out = {*to, to->count, to->faded};
    out.to.count = out.to.faded = 0;
    int32_t *memory = calloc(3 * size + 1, sizeof(int32_t));
    scratch_t scratch = {memory, memory + size, memory + 2 * size, 0, 0, 0};
    int failed = !memory;
    for (int part = 0; part < 2 * n && !failed; ++part) {
        const pairs_t *pairs = lists[part % n];
        if (part < n)
            failed = s->d == 3 ? all_point_contacts(3, s, x, dhat, pairs, &scratch, &out)
                               : all_point_contacts(2, s, x, dhat, pairs, &scratch, &out);
        for (int64_t k = 0; part >= n && k < pairs->n_edges; ++k)
            if (!(left(pairs, pairs->edge_bounds[k], pairs->edge_rates[k]) > (1.0 + BOUND_MARGIN) * dhat))
                edge_contact(s, x, dhat, pairs->edges[2 * k], pairs->edges[2 * k + 1], &out);
        counts[2 * part] = out.to.count, counts[2 * part + 1] = out.to.faded;
    }
    free(memory), free(scratch.nearest);
    return failed;
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

/* How many of a contact's vertices count: the others have the coefficient zero. */
INLINE int used(const double *coefficients)
{
    int n = 4;
    while (n > 1 && coefficients[n - 1] == 0.0)
        --n;
    return n;
}

/* The sum of weights times the law, and its gradient by the vertices (n, d), added to `gradient`. */
double barrier_sum(int d, const contacts_t *all, double dhat, double kappa, double *gradient)
{
    double total = 0.0, slope, second;
    for (int64_t k = 0; k < all->count; ++k) {
        const double *gap = all->gaps + d * k, *c = all->coefficients + 4 * k;
        total += all->weights[k] * law(dot(d, gap, gap), dhat, kappa, &slope, &second);
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

/* Blocks being found of vertices that have rows (`rows`, -1: none), on or right of the diagonal, in the rows from `first` to before `last`. */
typedef struct {
    const int64_t *rows;
    int64_t first, last, count;
    int64_t *to_rows, *to_columns;
    double *blocks;
} out_t;

/* Adds a block (d x d) of two vertices; returns where it goes, row by row, or 0 where it is not in these rows. */
INLINE double *add_block(int d, out_t *out, int32_t v, int32_t w, int *turned)
{
    const int64_t a = out->rows[v], b = out->rows[w], row = a < b ? a : b;
    if (a < 0 || b < 0 || row < out->first || row >= out->last)
        return 0;
    *turned = a >= b;
    out->to_rows[out->count] = row - out->first, out->to_columns[out->count] = a < b ? b : a;
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
