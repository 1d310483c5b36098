/* The contacts of a surface: vertices near half-spaces, and active pairs of primitives. */
#include "products.h"

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
    contacts_t *to;
    int64_t room, fades_room;
    const int8_t *owned; /* of the surface */
} found_t;

INLINE void emit(found_t *found, int n, const int32_t *vertices, const double *coefficients, const double *gap, double weight)
{
    const int64_t k = found->to->count++;
    if (k >= found->room)
        return;
    contact_t *out = found->to->contacts + k;
    for (int i = 0; i < 4; ++i) {
        out->vertices[i] = vertices[i < n ? i : 0];
        out->coefficients[i] = i < n ? coefficients[i] : 0.0;
    }
    for (int j = 0; j < 3; ++j)
        out->gap[j] = j < d ? gap[j] : 0.0;
    out->weight = weight;
    /* Every rank that owns a vertex has this contact: it counts where the first that is no obstacle's is owned. */
    int first = 0;
    while (first + 1 < n && found->owned[vertices[first]] < 0)
        ++first;
    out->counted = found->owned[vertices[first]] == 1;
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

/* Contacts of one point with the facets near it, the pairs from `first` to before `end`: the union of the facets counts once where they share edges and
 * vertices (inclusion and exclusion). */
INLINE void point_contacts(const surface_t *s, const double *x, double dhat, const pairs_t *all, place_t place, int64_t first,
                           int64_t end, scratch_t *scratch, found_t *out)
{
    const int32_t p = all->points[2 * first], stamp = ++scratch->stamp;
    const double reach = dhat * dhat, bounded = (1.0 + MARGIN) * dhat;
    int32_t count = 0, *counted = scratch->counted;
    const double *point = x + (int64_t)d * p;
    for (int64_t k = first; k < end; ++k) {
        if (left(place, all->point_bounds[k], all->point_rates[k]) > bounded)
            continue;
        const int64_t f = all->points[2 * k + 1];
        const int32_t *facet = s->facet + d * f;
        const double *corners[3] = {x + (int64_t)d * facet[0], x + (int64_t)d * facet[1], d == 3 ? x + (int64_t)d * facet[2] : 0};
        closest_t at;
        if (!(to_facet(point, corners, &at) < reach))
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
            if (to_edge(point, x + 3 * (int64_t)edge[0], x + 3 * (int64_t)edge[1], &at) < reach)
                add(scratch, at.kind == 1 ? edge[at.corner[0]] : s->vertices + e, &count, s->edge_share[e], &at, edge);
        }
        for (int i = 0; i < d; ++i) {
            const int32_t v = facet[i];
            if (!s->vertex_share[v] || counted[v] == stamp)
                continue;
            counted[v] = stamp;
            at.kind = 1, at.corner[0] = 0, at.share[0] = 1.0;
            minus(point, corners[i], at.gap);
            if (dot(at.gap, at.gap) < reach)
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
            emit(out, found->at.kind + 1, vertices, coefficients, found->at.gap, found->weight * s->areas[p]);
    }
}

/* From zero at t = 0 to one at t = 1 and beyond; F, F' and F''. */
INLINE void fade(double t, double *F)
{
    F[0] = t < 1.0 ? (2.0 - t) * t : 1.0, F[1] = t < 1.0 ? 2.0 - 2.0 * t : 0.0, F[2] = t < 1.0 ? -2.0 : 0.0;
}

/* The contact of two edges that cross. It fades where they are nearly parallel, and where an end of one is nearly as close to the other edge as the
 * closest points are: there the end's own contact takes over. The weight's derivatives are found where it fades. */
INLINE void edge_contact(const surface_t *s, const double *x, double dhat, int32_t one, int32_t other, found_t *found)
{
    contacts_t *out = found->to;
    const int32_t v[4] = {s->edge[2 * (int64_t)one], s->edge[2 * (int64_t)one + 1], s->edge[2 * (int64_t)other], s->edge[2 * (int64_t)other + 1]};
    const double *at[4];
    for (int i = 0; i < 4; ++i)
        at[i] = x + 3 * (int64_t)v[i];
    double a[3], b[3], w[3], gap[3];
    minus(at[1], at[0], a), minus(at[3], at[2], b), minus(at[2], at[0], w);
    const double aa = dot(a, a), ab = dot(a, b), bb = dot(b, b), aw = dot(a, w), bw = dot(b, w), det = aa * bb - ab * ab;
    const double s0 = aw * bb - bw * ab, t0 = ab * aw - aa * bw;
    if (!(s0 > 0.0 && t0 > 0.0 && s0 < det && t0 < det))
        return;
    const double c[4] = {1.0 - s0 / det, s0 / det, t0 / det - 1.0, -t0 / det};
    for (int j = 0; j < 3; ++j) /* from differences alone: far from the origin coordinates have lost the digits of a gap */
        gap[j] = c[1] * a[j] + c[3] * b[j] - w[j];
    const double D = dot(gap, gap);
    if (!(D < dhat * dhat))
        return;
    closest_t ends[4];
    double F[5][3], ratios[4], weight = fmin(s->edge_areas[one], s->edge_areas[other]);
    const double sine = det / (aa * bb);
    fade(sine / PARALLEL, F[4]);
    weight *= F[4][0];
    for (int i = 0; i < 4; ++i) {
        const int k = i < 2 ? 2 : 0;
        ratios[i] = to_edge(at[i], at[k], at[k + 1], ends + i) / D;
        fade(fmax(ratios[i] - 1.0, 0.0), F[i]);
        weight *= F[i][0];
    }
    if (!(weight > 0.0))
        return;
    const int fades = F[0][1] + F[1][1] + F[2][1] + F[3][1] + F[4][1] > 0.0;
    if (fades && out->count < found->room && out->faded < found->fades_room) {
        double rates[5][12] = {{0.0}}, of_gap[12], *gradient = out->fades[out->faded].first, (*H)[9] = out->fades[out->faded].second;
        memset(out->fades + out->faded, 0, sizeof(fade_t));
        out->fades[out->faded].contact = out->count;
        outer(c, gap, of_gap); /* half of D' */
        for (int i = 0; i < 4; ++i) {
            if (F[i][1] == 0.0)
                continue;
            const int k = i < 2 ? 2 : 0;
            double e[4] = {0.0}, of_end[12], slide[1][4] = {{0.0}}, edges[2][4] = OF_EDGES;
            e[i] = 1.0;
            for (int q = 0; q < ends[i].kind; ++q)
                e[k + ends[i].corner[q]] = -ends[i].share[q];
            slide[0][k] = 1.0, slide[0][k + 1] = -1.0;
            outer(e, ends[i].gap, of_end);
            const double share = weight * F[i][1] / F[i][0] / D;
            add_distance(share, ends[i].kind - 1, e, slide, at, ends[i].gap, H);
            add_distance(-share * ratios[i], 2, c, edges, at, gap, H);
            add_product(-8.0 * share / D, of_end, of_gap, H);
            add_square(4, 8.0 * share * ratios[i] / D, of_gap, H);
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
            for (int k = 0; k <= i && F[i][1] != 0.0; ++k)
                if (F[k][1] != 0.0)
                    add_product(k < i ? 2.0 * weight * F[i][1] / F[i][0] * F[k][1] / F[k][0] : weight * F[i][2] / F[i][0], rates[i], rates[k], H);
            for (int q = 0; q < 12 && F[i][1] != 0.0; ++q)
                gradient[q] += weight * F[i][1] / F[i][0] * rates[i][q];
        }
    }
    out->faded += fades;
    emit(found, 4, v, c, gap, weight);
}

/* The contacts of all vertices of a list. Returns 1 without memory. */
INLINE int all_point_contacts(const surface_t *s, const double *x, double dhat, const pairs_t *pairs, place_t place, scratch_t *scratch,
                              found_t *out)
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
        point_contacts(s, x, dhat, pairs, place, k, end, scratch, out);
    }
    return 0;
}

/* Contacts of this rank's vertices with half-spaces: with the foot on the plane, which moves as the plane's frame does. Behind a plane the gap is zero. */
INLINE void half_space_contacts(const surface_t *s, const double *x, double dhat, found_t *out)
{
    for (int64_t plane = 0; plane < s->planes; ++plane) {
        const int32_t origin = (int32_t)(s->vertices + (d + 1) * plane);
        const double *frame = x + (int64_t)d * origin;
        double axes[3][3];
        for (int i = 0; i < d; ++i)
            minus(frame + d * (i + 1), frame, axes[i]);
        for (int32_t v = 0; v < s->vertices; ++v) {
            const int32_t vertices[4] = {v, origin, origin + 2, origin + 3};
            double from[3], gap[3], coefficients[4] = {1.0, -1.0};
            if (s->owned[v] != 1)
                continue;
            minus(x + (int64_t)d * v, frame, from);
            const double height = dot(from, axes[0]);
            if (!(height < dhat))
                continue;
            for (int j = 0; j < d; ++j)
                gap[j] = fmax(height, 0.0) * axes[0][j];
            for (int i = 1; i < d; ++i)
                coefficients[i + 1] = -dot(from, axes[i]), coefficients[1] -= coefficients[i + 1];
            emit(out, d + 1, vertices, coefficients, gap, 2.0 * s->areas[v]); /* those are half of the surface's */
        }
    }
    out->to->half_spaces = out->to->count;
}

/* The contacts nearer than dhat, of half-spaces and among the candidates of n lists: first those of half-spaces, then those of points, list by list,
 * and then those of edges. `to` has room for so many as it counts, and counts them; of others nothing is written. Returns 1 without memory. */
int active_contacts(const surface_t *s, const double *x, double dhat, int n, pairs_t *const *lists, contacts_t *to)
{
    const int64_t size = s->vertices + s->edges + s->facets;
    found_t out = {to, to->count, to->faded, s->owned};
    to->count = to->faded = 0;
    half_space_contacts(s, x, dhat, &out);
    int32_t *memory = calloc(3 * size + 1, sizeof(int32_t));
    scratch_t scratch = {memory, memory + size, memory + 2 * size, 0, 0, 0};
    int failed = !memory;
    for (int part = 0; part < 2 * n && !failed; ++part) {
        const pairs_t *pairs = lists[part % n];
        if (!(part < n ? pairs->n_points : pairs->n_edges))
            continue;
        const place_t place = place_of(s, pairs, x);
        if (part < n)
            failed = all_point_contacts(s, x, dhat, pairs, place, &scratch, &out);
        for (int64_t k = 0; part >= n && k < pairs->n_edges; ++k)
            if (!(left(place, pairs->edge_bounds[k], pairs->edge_rates[k]) > (1.0 + MARGIN) * dhat))
                edge_contact(s, x, dhat, pairs->edges[2 * k], pairs->edges[2 * k + 1], &out);
    }
    free(memory), free(scratch.nearest);
    return failed;
}
