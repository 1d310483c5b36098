/* The broad phase: pairs of primitives that are near, by a tree of boxes over the facets, and then by their distance.
 *
 * A leaf holds a few facets, and each vertex and edge belongs to one leaf. Pairs come in the order of the tree, which is that of the rest state: the
 * order of the pairs of a list does not depend on where or how widely was searched. */
#include "surface.h"

/* A box: its least coordinates, and from SIDE on its greatest with the opposite sign; zeros where d = 2. */
enum { SIDE = 4, BOX = 2 * SIDE };

INLINE double least(double a, double b)
{
    return b < a ? b : a;
}

/* The box of n vertices on the way from x to y. */
INLINE void enclose(int n, const int32_t *vertices, const double *x, const double *y, double *box)
{
    for (int j = 0; j < BOX; ++j)
        box[j] = j % SIDE < d ? INFINITY : 0.0;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < d; ++j) {
            const double from = x[(int64_t)d * vertices[i] + j], to = y[(int64_t)d * vertices[i] + j];
            box[j] = least(box[j], least(from, to)), box[SIDE + j] = least(box[SIDE + j], least(-from, -to));
        }
}

INLINE void join(double *box, const double *other)
{
    for (int j = 0; j < BOX; ++j)
        box[j] = least(box[j], other[j]);
}

/* Those of n boxes (or of the boxes that `of` numbers) that are no further from `box` than `distance`; returns how many. */
INLINE int64_t meet(const double *box, int64_t n, const int32_t *of, int64_t first, const double *boxes, double distance, int32_t *found)
{
    int64_t count = 0;
    for (int64_t i = 0; i < n; ++i) {
        const int64_t k = of ? of[i] : first + i;
        double gaps[BOX];
        for (int j = 0; j < BOX; ++j)
            gaps[j] = box[(j + SIDE) % BOX] + boxes[BOX * k + j];
        for (int half = SIDE; half; half /= 2)
            for (int j = 0; j < half; ++j)
                gaps[j] = gaps[j + half] > gaps[j] ? gaps[j + half] : gaps[j];
        found[count] = (int32_t)k, count += gaps[0] <= distance;
    }
    return count;
}

/* Boxes of the nodes of an object while its vertices go from x to y; behind all nodes those of facets, and then those of edges, leaf by leaf. */
INLINE void fit(const surface_t *s, int64_t object, const double *x, const double *y, double *boxes)
{
    double *facets = boxes + BOX * (int64_t)s->roots[s->objects], *edges = facets + BOX * s->facets;
    for (int64_t node = s->roots[object + 1] - 1; node >= s->roots[object]; --node) {
        double *box = boxes + BOX * node;
        const int64_t leaf = s->leaf[node];
        if (leaf < 0) {
            memcpy(box, box + BOX, BOX * sizeof(double)), join(box, boxes + BOX * (int64_t)s->skip[node + 1]);
            continue;
        }
        for (int32_t k = s->leaf_facet_starts[leaf]; k < s->leaf_facet_starts[leaf + 1]; ++k) {
            enclose(d, s->facet + (int64_t)d * s->leaf_facets[k], x, y, facets + BOX * (int64_t)k);
            if (k == s->leaf_facet_starts[leaf])
                memcpy(box, facets + BOX * (int64_t)k, BOX * sizeof(double));
            join(box, facets + BOX * (int64_t)k);
        }
        for (int32_t k = s->leaf_edge_starts[leaf]; d == 3 && k < s->leaf_edge_starts[leaf + 1]; ++k)
            enclose(2, s->edge + 2 * (int64_t)s->leaf_edges[k], x, y, edges + BOX * (int64_t)k);
    }
}

/* The same of all objects that are marked. */
void fit_boxes(const surface_t *s, const uint8_t *marked, const double *x, const double *y, double *boxes)
{
    for (int64_t object = 0; object < s->objects; ++object)
        if (marked[object])
            fit(s, object, x, y, boxes);
}

INLINE int share(int n, const int32_t *one, int m, const int32_t *other)
{
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < m; ++k)
            if (one[i] == other[k])
                return 1;
    return 0;
}

/* Whether one of n vertices is of this rank. */
INLINE int owns(const surface_t *s, int n, const int32_t *vertices)
{
    for (int i = 0; i < n; ++i)
        if (s->owned[vertices[i]] == 1)
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
    double *bounds;
} list_t;

INLINE void append(list_t *list, int32_t a, int32_t b, double bound)
{
    if (list->count < list->capacity)
        list->pairs[2 * list->count] = a, list->pairs[2 * list->count + 1] = b, list->bounds[list->count] = bound;
    ++list->count;
}

/* Scratch memory of a search: nodes that are near each node on the way from a root to a leaf, and primitives that are near. */
typedef struct {
    int32_t *nodes, *leaves, *facets, *edges, *near;
} room_t;

/* Pairs of the vertices and edges of a leaf with the leaves of n nodes. A vertex has all of its pairs, or none: the union of its facets is what counts. */
INLINE void leaf_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance, int64_t node, int64_t n,
                       const int32_t *nodes, const room_t *room, list_t *points, list_t *edges)
{
    const int moving = x != y;
    const int64_t leaf = s->leaf[node];
    const double *box = boxes + BOX * node, *of_facets = boxes + BOX * (int64_t)s->roots[s->objects], *of_edges = of_facets + BOX * s->facets;
    int64_t n_facets = 0, n_edges = 0;
    for (int64_t i = 0; i < n; ++i) {
        const int64_t other = s->leaf[nodes[i]];
        const int32_t *facets = s->leaf_facet_starts + other, *lines = s->leaf_edge_starts + other;
        n_facets += meet(box, facets[1] - facets[0], 0, facets[0], of_facets, distance, room->facets + n_facets);
        if (d == 3 && other >= leaf)
            n_edges += meet(box, lines[1] - lines[0], 0, lines[0], of_edges, distance, room->edges + n_edges);
    }
    for (int32_t k = s->leaf_vertex_starts[leaf]; k < s->leaf_vertex_starts[leaf + 1]; ++k) {
        const int32_t p = s->leaf_vertices[k];
        double point[BOX];
        enclose(1, &p, x, y, point);
        const int64_t near = meet(point, n_facets, room->facets, 0, of_facets, distance, room->near), before = points->count;
        int wanted = owns(s, 1, &p);
        for (int64_t i = 0; i < near; ++i) {
            const int32_t f = s->leaf_facets[room->near[i]], *facet = s->facet + (int64_t)d * f;
            const double *corners[3] = {x + (int64_t)d * facet[0], x + (int64_t)d * facet[1], d == 3 ? x + (int64_t)d * facet[2] : 0};
            closest_t closest;
            if (share(1, &p, d, facet))
                continue;
            const double squared = to_facet(x + (int64_t)d * p, corners, &closest);
            if (within(distance + (moving ? approach(1, &p, d, facet, x, y) : 0.0), squared))
                append(points, p, f, sqrt(squared)), wanted = wanted || owns(s, d, facet);
        }
        points->count = wanted ? points->count : before;
    }
    for (int32_t k = s->leaf_edge_starts[leaf]; d == 3 && k < s->leaf_edge_starts[leaf + 1]; ++k) {
        const int32_t e = s->leaf_edges[k], *one = s->edge + 2 * (int64_t)e;
        const int64_t near = meet(of_edges + BOX * (int64_t)k, n_edges, room->edges, 0, of_edges, distance, room->near);
        for (int64_t i = 0; i < near; ++i) {
            const int32_t *other = s->edge + 2 * (int64_t)s->leaf_edges[room->near[i]];
            double a, b;
            if (room->near[i] <= k || share(2, one, 2, other) || !(owns(s, 2, one) || owns(s, 2, other)))
                continue;
            const double squared =
                between_segments(x + 3 * (int64_t)one[0], x + 3 * (int64_t)one[1], x + 3 * (int64_t)other[0], x + 3 * (int64_t)other[1], &a, &b);
            if (within(distance + (moving ? approach(2, one, 2, other, x, y) : 0.0), squared))
                append(edges, e, s->leaf_edges[room->near[i]], sqrt(squared));
        }
    }
}

/* The n nodes that are near a node: children in place of nodes that have some, all leaves in place of nodes where the node is a leaf. */
INLINE int64_t refine(const surface_t *s, const double *boxes, double distance, int64_t node, int64_t n, const int32_t *nodes, int32_t *found)
{
    int64_t count = 0;
    const double *box = boxes + BOX * node;
    for (int64_t i = 0; i < n; ++i)
        for (int32_t k = nodes[i], end = s->skip[k]; k < end;) {
            const int32_t child = k + 1;
            if (!meet(box, 1, 0, k, boxes, distance, found + count)) {
                k = s->skip[k];
            } else if (s->leaf[k] >= 0) {
                ++count, k = s->skip[k];
            } else if (s->leaf[node] >= 0) {
                k = child;
            } else {
                count += meet(box, 1, 0, child, boxes, distance, found + count);
                count += meet(box, 1, 0, s->skip[child], boxes, distance, found + count);
                k = s->skip[k];
            }
        }
    return count;
}

enum { DEPTH = 64 }; /* of trees whose nodes are halved */

INLINE void search(const surface_t *s, const double *boxes, const double *x, const double *y, double distance, const uint8_t *meets,
                   const room_t *room, list_t *points, list_t *edges)
{
    for (int64_t object = 0; object < s->objects; ++object) {
        int64_t ends[DEPTH + 1], starts[DEPTH + 2] = {0, 0}, depth = 0; /* of the nodes on the way; where their near nodes are */
        for (int64_t other = 0; other < s->objects; ++other)
            if (meets[object * s->objects + other] && s->roots[other] < s->roots[other + 1])
                room->nodes[starts[1]++] = s->roots[other];
        ends[0] = s->roots[object + 1];
        for (int64_t node = s->roots[object]; node < s->roots[object + 1];) {
            while (node >= ends[depth])
                --depth;
            const int64_t begin = starts[depth + 1], leaf = s->leaf[node];
            int32_t *near = leaf < 0 ? room->nodes + begin : room->leaves;
            int64_t n = refine(s, boxes, distance, node, begin - starts[depth], room->nodes + starts[depth], near);
            int wanted = s->holds[node];
            for (int64_t i = 0; i < n && !wanted; ++i)
                wanted = s->holds[near[i]];
            n = wanted ? n : 0;
            if (leaf >= 0 && n)
                leaf_pairs(s, boxes, x, y, distance, node, n, room->leaves, room, points, edges);
            if (leaf < 0 && n)
                ends[++depth] = s->skip[node], starts[depth + 1] = begin + n;
            node = leaf < 0 && n ? node + 1 : s->skip[node];
        }
    }
}

/* Pairs of vertices and facets, and of edges, that come within `distance` while the vertices go straight from x to y (x itself where nothing
 * moves), between the objects that `meets` names: those that touch vertices of this rank, and the other pairs of a vertex that has one of those. Boxes
 * must be those of x and y. found: room for as many pairs as it says; how many there are, with their distances at x. Returns 1 without memory. */
int search_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance, const uint8_t *meets, pairs_t *found,
                 int32_t *points, int32_t *edges)
{
    const int64_t most = s->edges > s->facets ? s->edges : s->facets, nodes = (DEPTH + 1) * (s->leaves + s->objects);
    int32_t *memory = malloc((nodes + s->leaves + s->facets + s->edges + most + 8) * sizeof(int32_t));
    if (!memory)
        return 1;
    room_t room = {memory, memory + nodes, 0, 0, 0};
    room.facets = room.leaves + s->leaves + 2, room.edges = room.facets + s->facets + 2, room.near = room.edges + s->edges + 2;
    list_t p = {0, found->n_points, points, found->point_bounds}, e = {0, found->n_edges, edges, found->edge_bounds};
    search(s, boxes, x, y, distance, meets, &room, &p, &e);
    free(memory);
    found->n_points = p.count, found->n_edges = e.count;
    return 0;
}
