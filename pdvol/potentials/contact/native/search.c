/* The broad phase: pairs of primitives that are near, by a tree of boxes over the facets, and then by their distance.
 *
 * A leaf holds a few facets, and each vertex and edge belongs to one leaf. Pairs come in the order of the tree, which is that of the rest state: the
 * order of the pairs of a list does not depend on where or how widely was searched. */
#include "surface.h"

enum { MAX_ADVANCES = 1000 }; /* of one pair: bounds the time that a pair takes */
#define ADVANCE 0.9            /* share of the safe advance: the rest is for round-off */
#define ADVANCED 1e-6          /* share of the distance to keep: nearer than that to it the advance ends; it makes steps continuous */

INLINE void grow(int d, const double *x, double *box)
{
    for (int j = 0; j < d; ++j) {
        box[j] = fmin(box[j], x[j]);
        box[d + j] = fmax(box[d + j], x[j]);
    }
}

INLINE void clear(int d, double *box)
{
    for (int j = 0; j < d; ++j)
        box[j] = INFINITY, box[d + j] = -INFINITY;
}

INLINE int meet(int d, const double *a, const double *b, double distance)
{
    int apart = 0;
    for (int j = 0; j < d; ++j)
        apart |= (a[j] > b[d + j] + distance) | (b[j] > a[d + j] + distance);
    return !apart;
}

/* The box of n vertices on the way from x to y. */
INLINE void enclose(int d, int n, const int32_t *vertices, const double *x, const double *y, double *box)
{
    clear(d, box);
    for (int i = 0; i < n; ++i)
        grow(d, x + (int64_t)d * vertices[i], box), grow(d, y + (int64_t)d * vertices[i], box);
}

/* Boxes (nodes, 2 d) of the nodes of an object while its vertices go from x to y. */
INLINE void fit(int d, const surface_t *s, int64_t object, const double *x, const double *y, double *boxes)
{
    for (int64_t node = s->roots[object + 1] - 1; node >= s->roots[object]; --node) {
        double *box = boxes + 2 * d * node;
        clear(d, box);
        if (s->leaf[node] >= 0) {
            const int32_t *starts = s->leaf_facet_starts + s->leaf[node];
            for (int32_t k = starts[0]; k < starts[1]; ++k) {
                double facet[6];
                enclose(d, d, s->facet + (int64_t)d * s->leaf_facets[k], x, y, facet);
                grow(d, facet, box), grow(d, facet + d, box);
            }
        } else {
            const double *children[2] = {boxes + 2 * d * (node + 1), boxes + 2 * d * s->skip[node + 1]};
            for (int i = 0; i < 2; ++i)
                grow(d, children[i], box), grow(d, children[i] + d, box);
        }
    }
}

/* The same of all objects that are marked. */
void fit_boxes(const surface_t *s, const uint8_t *marked, const double *x, const double *y, double *boxes)
{
    for (int64_t object = 0; object < s->objects; ++object)
        if (marked[object] && s->d == 3)
            fit(3, s, object, x, y, boxes);
        else if (marked[object])
            fit(2, s, object, x, y, boxes);
}

/* Largest relative motion of two primitives, whose vertices move by y - x: their distance changes by no more. */
INLINE double approach(int d, int n, const int32_t *one, int m, const int32_t *other, const double *x, const double *y)
{
    double most = 0.0;
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < m; ++k) {
            const int64_t a = (int64_t)d * one[i], b = (int64_t)d * other[k];
            double size = 0.0;
            for (int j = 0; j < d; ++j) {
                const double move = (y[a + j] - x[a + j]) - (y[b + j] - x[b + j]);
                size += move * move;
            }
            most = fmax(most, size);
        }
    return sqrt(most);
}

INLINE int share(int n, const int32_t *one, int m, const int32_t *other)
{
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < m; ++k)
            if (one[i] == other[k])
                return 1;
    return 0;
}

INLINE int within(double distance, double squared)
{
    return squared <= distance * distance;
}

typedef struct {
    int64_t count, capacity;
    int32_t *pairs;
} list_t;

INLINE void append(list_t *list, int32_t a, int32_t b)
{
    if (list->count < list->capacity)
        list->pairs[2 * list->count] = a, list->pairs[2 * list->count + 1] = b;
    ++list->count;
}

INLINE void search(int d, const surface_t *s, const double *boxes, const double *x, const double *y, double distance, const uint8_t *meets,
                   int64_t first, int64_t last, int32_t *found, double *lines, list_t *points, list_t *edges)
{
    const int moving = x != y;
    int64_t object = 0;
    for (int64_t k = 0; d == 3 && k < s->leaf_edge_starts[s->leaves]; ++k)
        enclose(3, 2, s->edge + 2 * (int64_t)s->leaf_edges[k], x, y, lines + 6 * k);
    for (int64_t leaf = first; leaf < last; ++leaf) {
        const int32_t *own = s->leaf_facets + s->leaf_facet_starts[leaf];
        while (s->leaf[s->roots[object + 1] - 1] < leaf)
            ++object;
        double box[6];
        clear(d, box);
        for (int32_t k = 0; k < s->leaf_facet_starts[leaf + 1] - s->leaf_facet_starts[leaf]; ++k) {
            double facet[6];
            enclose(d, d, s->facet + (int64_t)d * own[k], x, y, facet);
            grow(d, facet, box), grow(d, facet + d, box);
        }
        int64_t n = 0; /* nodes of leaves that are near */
        for (int64_t other = 0; other < s->objects; ++other) {
            if (!meets[object * s->objects + other])
                continue;
            for (int32_t node = s->roots[other]; node < s->roots[other + 1];) {
                if (!meet(d, box, boxes + 2 * d * (int64_t)node, distance))
                    node = s->skip[node];
                else {
                    if (s->leaf[node] >= 0)
                        found[n++] = node;
                    ++node;
                }
            }
        }
        if (!n)
            continue;
        for (int32_t k = s->leaf_vertex_starts[leaf]; k < s->leaf_vertex_starts[leaf + 1]; ++k) {
            const int32_t p = s->leaf_vertices[k];
            double point[6];
            enclose(d, 1, &p, x, y, point);
            for (int64_t i = 0; i < n; ++i) {
                if (!meet(d, point, boxes + 2 * d * (int64_t)found[i], distance))
                    continue;
                const int32_t *starts = s->leaf_facet_starts + s->leaf[found[i]];
                for (int32_t q = starts[0]; q < starts[1]; ++q) {
                    const int32_t f = s->leaf_facets[q], *facet = s->facet + (int64_t)d * f;
                    double around[6];
                    if (share(1, &p, d, facet))
                        continue;
                    enclose(d, d, facet, x, y, around);
                    if (!meet(d, point, around, distance))
                        continue;
                    const double *corners[3] = {x + (int64_t)d * facet[0], x + (int64_t)d * facet[1], d == 3 ? x + (int64_t)d * facet[2] : 0};
                    closest_t closest;
                    if (within(distance + (moving ? approach(d, 1, &p, d, facet, x, y) : 0.0), to_facet(d, x + (int64_t)d * p, corners, &closest)))
                        append(points, p, f);
                }
            }
        }
        if (d == 2)
            continue;
        for (int32_t k = s->leaf_edge_starts[leaf]; k < s->leaf_edge_starts[leaf + 1]; ++k) {
            const int32_t e = s->leaf_edges[k], *one = s->edge + 2 * (int64_t)e;
            const double *edge = lines + 6 * k;
            for (int64_t i = 0; i < n; ++i) {
                const int32_t facing = s->leaf[found[i]];
                if (facing < leaf || !meet(3, edge, boxes + 6 * (int64_t)found[i], distance))
                    continue;
                for (int32_t q = s->leaf_edge_starts[facing]; q < s->leaf_edge_starts[facing + 1]; ++q) {
                    const int32_t *other = s->edge + 2 * (int64_t)s->leaf_edges[q];
                    double a, b;
                    if (!meet(3, edge, lines + 6 * (int64_t)q, distance) || (facing == leaf && q <= k) || share(2, one, 2, other))
                        continue;
                    const double squared = between_segments(x + 3 * (int64_t)one[0], x + 3 * (int64_t)one[1], x + 3 * (int64_t)other[0],
                                                            x + 3 * (int64_t)other[1], &a, &b);
                    if (within(distance + (moving ? approach(3, 2, one, 2, other, x, y) : 0.0), squared))
                        append(edges, e, s->leaf_edges[q]);
                }
            }
        }
    }
}

/* Pairs of vertices and facets, and of edges, that come within `distance` while the vertices go straight from x to y (x itself where nothing
 * moves), between the objects that `meets` names, of the leaves from `first` to before `last` with all others. Boxes must be those of x and y.
 * counts: how many there are of each kind; no more than `capacities` are written. Returns 1 without memory. */
int search_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance, const uint8_t *meets, int64_t first,
                 int64_t last, const int64_t *capacities, int32_t *points, int32_t *edges, int64_t *counts)
{
    int32_t *found = malloc((s->leaves + 1) * sizeof(int32_t));
    double *lines = malloc((6 * s->edges + 1) * sizeof(double)); /* boxes of edges, leaf by leaf */
    if (!found || !lines) {
        free(found), free(lines);
        return 1;
    }
    list_t p = {0, capacities[0], points}, e = {0, capacities[1], edges};
    if (s->d == 3)
        search(3, s, boxes, x, y, distance, meets, first, last, found, lines, &p, &e);
    else
        search(2, s, boxes, x, y, distance, meets, first, last, found, lines, &p, &e);
    free(found), free(lines);
    counts[0] = p.count, counts[1] = e.count;
    return 0;
}

/* The longest step in [0, 1] along which a pair keeps the distance `kept`, by conservative advancement (Li et al. 2021, additive CCD). Bounded:
 * it ends early, with a smaller step, which is safe. */
INLINE double advance(int d, int n, const int32_t *one, int m, const int32_t *other, const double *x, const double *y, double dhat, double gap_share,
                      double step)
{
    double p[3][3], q[3][3], s, t;
    const double speed = approach(d, n, one, m, other, x, y);
    const double *corners[3] = {q[0], q[1], q[2]};
    double at = 0.0, kept = 0.0;
    for (int round = 0; round < MAX_ADVANCES; ++round) {
        for (int j = 0; j < d; ++j) {
            for (int i = 0; i < n; ++i)
                p[i][j] = x[(int64_t)d * one[i] + j] + at * (y[(int64_t)d * one[i] + j] - x[(int64_t)d * one[i] + j]);
            for (int i = 0; i < m; ++i)
                q[i][j] = x[(int64_t)d * other[i] + j] + at * (y[(int64_t)d * other[i] + j] - x[(int64_t)d * other[i] + j]);
        }
        closest_t closest;
        const double distance = sqrt(n == 1 ? to_facet(d, p[0], corners, &closest) : between_segments(p[0], p[1], q[0], q[1], &s, &t));
        if (round == 0)
            kept = gap_share * fmin(distance, dhat);
        const double room = distance - kept;
        if (room >= (step - at) * speed)
            return step;
        if (round > 0 && room <= ADVANCED * kept)
            return at;
        at += ADVANCE * room / speed;
    }
    return at;
}

/* The longest step in [0, 1] from x towards y after which each pair has kept at least the share `gap_share` of its gap, or of dhat. */
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share, int64_t n_points, const int32_t *points,
                    int64_t n_edges, const int32_t *edges, double step)
{
    const int d = s->d;
    for (int64_t k = 0; k < n_points; ++k) {
        const int32_t *pair = points + 2 * k, *facet = s->facet + (int64_t)d * pair[1];
        step = d == 3 ? advance(3, 1, pair, 3, facet, x, y, dhat, gap_share, step) : advance(2, 1, pair, 2, facet, x, y, dhat, gap_share, step);
    }
    for (int64_t k = 0; k < n_edges; ++k)
        step = advance(3, 2, s->edge + 2 * (int64_t)edges[2 * k], 2, s->edge + 2 * (int64_t)edges[2 * k + 1], x, y, dhat, gap_share, step);
    return step;
}
