/* The broad phase: pairs of primitives that are near, by a tree of boxes over the facets, and then by their distance.
 *
 * A leaf holds a few facets, and each vertex and edge belongs to one leaf. Pairs come in the order of the tree, which is that of the rest state: the
 * order of the pairs of a list does not depend on where or how widely was searched. */
#include "surface.h"

enum { MAX_ADVANCES = 1000 }; /* advances of one pair: bounds the time that it takes. After a third of them the pair slides, and its normal decides */
#define LEAST_GAP 1e-3         /* of dhat: steps leave it at least. There the barrier's pressure is 600 times the softest Young's modulus */
#define ADVANCE 0.9           /* share of the safe advance: the rest is for round-off */

/* A box: its least coordinates, and from SIDE on its greatest with the opposite sign; zeros where d = 2. */
enum { SIDE = 4, BOX = 2 * SIDE };

INLINE double least(double a, double b)
{
    return b < a ? b : a;
}

/* The box of n vertices on the way from x to y. */
INLINE void enclose(int d, int n, const int32_t *vertices, const double *x, const double *y, double *box)
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
INLINE void fit(int d, const surface_t *s, int64_t object, const double *x, const double *y, double *boxes)
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
            enclose(d, d, s->facet + (int64_t)d * s->leaf_facets[k], x, y, facets + BOX * (int64_t)k);
            if (k == s->leaf_facet_starts[leaf])
                memcpy(box, facets + BOX * (int64_t)k, BOX * sizeof(double));
            join(box, facets + BOX * (int64_t)k);
        }
        for (int32_t k = s->leaf_edge_starts[leaf]; d == 3 && k < s->leaf_edge_starts[leaf + 1]; ++k)
            enclose(3, 2, s->edge + 2 * (int64_t)s->leaf_edges[k], x, y, edges + BOX * (int64_t)k);
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

/* How vertices are away from the nearest place on the straight way from `start` by `move` (0: `start` itself): the mean vector of each object's
 * (`drift`), and the largest length of what is left without it (`sizes`). `firsts`: (objects + 1) where the objects' vertices begin. */
INLINE void deviations(int d, int64_t objects, const int64_t *firsts, const double *start, const double *move, const double *vertices, double *drift,
                       double *sizes)
{
    double along = 0.0, size = 0.0;
    for (int64_t k = 0; move && k < d * firsts[objects]; ++k)
        along += (vertices[k] - start[k]) * move[k], size += move[k] * move[k];
    const double share = size > 0.0 ? clamp(along / size) : 0.0;
    for (int64_t object = 0; object < objects; ++object) {
        const int64_t first = d * firsts[object], end = d * firsts[object + 1];
        double sum[3] = {0.0}, most = 0.0;
        for (int pass = 0; pass < 2; ++pass)
            for (int64_t k = first; k < end; k += d) {
                double own = 0.0;
                for (int j = 0; j < d; ++j) {
                    const double off = vertices[k + j] - start[k + j] - (move ? share * move[k + j] : 0.0) - (pass ? drift[3 * object + j] : 0.0);
                    sum[j] += off, own += off * off;
                }
                most = pass && !(own <= most) ? own : most;
                if (!pass && k + d == end)
                    for (int j = 0; j < d; ++j)
                        drift[3 * object + j] = d * sum[j] / (end - first);
            }
        sizes[object] = sqrt(most);
    }
}

/* The least that is left of the `room` (objects, objects) by which parts of two objects, or of one, may come nearer to each other since `start`, or a
 * place on the way from there by `move`. Negative where memory ran out. */
double spare_room(int d, int64_t objects, const int64_t *firsts, const double *start, const double *move, const double *vertices, const double *room)
{
    double *drift = calloc(4 * objects + 1, sizeof(double)), *sizes = drift + 3 * objects, spare = drift ? INFINITY : -1.0;
    if (drift && d == 3)
        deviations(3, objects, firsts, start, move, vertices, drift, sizes);
    else if (drift)
        deviations(2, objects, firsts, start, move, vertices, drift, sizes);
    for (int64_t one = 0; drift && one < objects; ++one)
        for (int64_t other = one; other < objects; ++other) {
            double size = 0.0;
            for (int j = 0; j < 3; ++j)
                size += (drift[3 * one + j] - drift[3 * other + j]) * (drift[3 * one + j] - drift[3 * other + j]);
            const double left = room[objects * one + other] - (sqrt(size) + sizes[one] + sizes[other]);
            spare = !(spare <= left) ? left : spare;
        }
    free(drift);
    return spare;
}

/* The rotation of the polar decomposition of m (3, 3), by Newton's iteration (Higham 1986); the identity where there is none or it is slow. */
static void polar_rotation(const double *m, double *r)
{
    double change = 1.0, size = 0.0;
    for (int k = 0; k < 9; ++k)
        size += m[k] * m[k];
    for (int k = 0; k < 9; ++k)
        r[k] = m[k] / sqrt(size);
    for (int count = 0; change > 1e-24 && count < 50; ++count) {
        double cofactors[9], own = 0.0, of_inverse = 0.0;
        for (int i = 0; i < 3; ++i)
            for (int j = 0; j < 3; ++j) {
                const int a = 3 * ((i + 1) % 3), b = 3 * ((i + 2) % 3), c = (j + 1) % 3, e = (j + 2) % 3;
                cofactors[3 * i + j] = r[a + c] * r[b + e] - r[a + e] * r[b + c];
            }
        const double det = r[0] * cofactors[0] + r[1] * cofactors[1] + r[2] * cofactors[2];
        if (!(det > 0.0))
            break;
        for (int k = 0; k < 9; ++k)
            own += r[k] * r[k], of_inverse += (cofactors[k] / det) * (cofactors[k] / det);
        const double scale = sqrt(sqrt(of_inverse / own));
        change = 0.0;
        for (int k = 0; k < 9; ++k) {
            const double next = 0.5 * (scale * r[k] + cofactors[k] / (det * scale));
            change += (next - r[k]) * (next - r[k]), r[k] = next;
        }
    }
    for (int k = 0; !(change <= 1e-24) && k < 9; ++k)
        r[k] = k % 4 == 0;
}

INLINE void move_all_back(int d, int64_t objects, const int64_t *firsts, int turned, const double *start, double *vertices, double *turns)
{
    for (int64_t object = 0; object < objects; ++object) {
        const int64_t first = firsts[object], count = firsts[object + 1] - first;
        const double *x = start + d * first;
        double *y = vertices + d * first, before[3] = {0.0}, after[3] = {0.0}, sums[9] = {0.0}, *turn = turns + 9 * object;
        for (int64_t k = 0; k < d * count; k += d)
            for (int j = 0; j < d; ++j)
                before[j] += x[k + j] / count, after[j] += y[k + j] / count;
        for (int64_t k = 0; turned && k < d * count; k += d)
            for (int i = 0; i < d; ++i)
                for (int j = 0; j < d; ++j)
                    sums[3 * i + j] += (y[k + i] - after[i]) * (x[k + j] - before[j]);
        if (d == 2)
            sums[8] = sqrt(sums[0] * sums[0] + sums[1] * sums[1] + sums[3] * sums[3] + sums[4] * sums[4]);
        polar_rotation(sums, turn);
        for (int64_t k = 0; k < d * count; k += d) {
            double q[3] = {0.0};
            for (int j = 0; j < d; ++j)
                q[j] = y[k + j] - after[j];
            for (int j = 0; j < d; ++j)
                y[k + j] = before[j] + q[0] * turn[j] + q[1] * turn[3 + j] + q[2] * turn[6 + j];
        }
    }
}

/* Takes the rigid motion of each object since `start` from its vertices, or its shift alone where not `turned`. `turns` (objects, 3, 3): by how much
 * each was turned. */
void move_back(int d, int64_t objects, const int64_t *firsts, int turned, const double *start, double *vertices, double *turns)
{
    if (d == 3)
        move_all_back(3, objects, firsts, turned, start, vertices, turns);
    else
        move_all_back(2, objects, firsts, turned, start, vertices, turns);
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
INLINE void leaf_pairs(int d, const surface_t *s, const double *boxes, const double *x, const double *y, double distance, int64_t node, int64_t n,
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
        enclose(d, 1, &p, x, y, point);
        const int64_t near = meet(point, n_facets, room->facets, 0, of_facets, distance, room->near), before = points->count;
        int wanted = owns(s, 1, &p);
        for (int64_t i = 0; i < near; ++i) {
            const int32_t f = s->leaf_facets[room->near[i]], *facet = s->facet + (int64_t)d * f;
            const double *corners[3] = {x + (int64_t)d * facet[0], x + (int64_t)d * facet[1], d == 3 ? x + (int64_t)d * facet[2] : 0};
            closest_t closest;
            if (share(1, &p, d, facet))
                continue;
            const double squared = to_facet(d, x + (int64_t)d * p, corners, &closest);
            if (within(distance + (moving ? approach(d, 1, &p, d, facet, x, y) : 0.0), squared))
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
            if (within(distance + (moving ? approach(3, 2, one, 2, other, x, y) : 0.0), squared))
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

INLINE void search(int d, const surface_t *s, const double *boxes, const double *x, const double *y, double distance, const uint8_t *meets,
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
                leaf_pairs(d, s, boxes, x, y, distance, node, n, room->leaves, room, points, edges);
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
    if (s->d == 3)
        search(3, s, boxes, x, y, distance, meets, &room, &p, &e);
    else
        search(2, s, boxes, x, y, distance, meets, &room, &p, &e);
    free(memory);
    found->n_points = p.count, found->n_edges = e.count;
    return 0;
}

/* The unit normal of a gap (d) whose closest points are free to slide along k sides: across these it has but round-off, which over the size of a
 * primitive is more than a small gap. */
INLINE void unit_across(int d, int k, double (*sides)[3], double *gap)
{
    for (int i = 0; i < k; ++i) {
        const double share = dot(d, sides[i], gap) / dot(d, sides[i], sides[i]);
        for (int j = 0; j < d; ++j)
            gap[j] -= share * sides[i][j];
    }
    const double size = sqrt(dot(d, gap, gap));
    for (int j = 0; j < d; ++j)
        gap[j] /= size;
}

INLINE double volume(const double *a, const double *u, const double *v, double sign)
{
    double normal[3];
    cross(u, v, normal);
    return sign * dot(3, a, normal);
}

/* Until which share of the way, from `at` to `step`, two lines, or a point and a plane, stay apart by `kept` in any case: the volume of the vector
 * between them and of two sides is a cubic of time, and its coefficients over an interval (Bernstein's) bound it; so do those of the sides' cross
 * product. ways (3, 2, 3): that vector and the sides at the way's start and end. */
INLINE double apart_by_volume(double (*ways)[2][3], double at, double step, double kept)
{
    double lo = at, hi = step, reach, sign = 0.0;
    for (int trial = 0; trial < MAX_ADVANCES && lo < step; ++trial) {
        double e[3][2][3], products[3][3], more[3], area = 0.0;
        for (int k = 0; k < 3; ++k)
            for (int end = 0; end < 2; ++end)
                for (int j = 0; j < 3; ++j)
                    e[k][end][j] = ways[k][0][j] + (end ? hi : lo) * (ways[k][1][j] - ways[k][0][j]);
        double (*a)[3] = e[0], (*u)[3] = e[1], (*v)[3] = e[2];
        if (trial == 0)
            sign = volume(a[0], u[0], v[0], 1.0) < 0.0 ? -1.0 : 1.0;
        cross(u[0], v[0], products[0]), cross(u[1], v[1], products[2]), cross(u[0], v[1], products[1]), cross(u[1], v[0], more);
        for (int j = 0; j < 3; ++j)
            products[1][j] = 0.5 * (products[1][j] + more[j]);
        for (int k = 0; k < 3; ++k)
            area = fmax(area, sqrt(dot(3, products[k], products[k])));
        const double c1 = (volume(a[1], u[0], v[0], sign) + volume(a[0], u[1], v[0], sign) + volume(a[0], u[0], v[1], sign)) / 3.0;
        const double c2 = (volume(a[0], u[1], v[1], sign) + volume(a[1], u[0], v[1], sign) + volume(a[1], u[1], v[0], sign)) / 3.0;
        const double least = fmin(fmin(volume(a[0], u[0], v[0], sign), c1), fmin(c2, volume(a[1], u[1], v[1], sign)));
        if (least >= kept * area)
            reach = 2.0 * (hi - lo), lo = hi, hi = fmin(step, lo + reach);
        else
            hi = 0.5 * (lo + hi);
    }
    return lo;
}

/* For how long two primitives, of n and m vertices at p and q that go from x to y, stay apart by `kept` along a unit normal, that of their gap: of each
 * two vertices the distance along it changes at a constant rate. */
INLINE double apart_along(int d, int n, const int32_t *one, double (*p)[3], int m, const int32_t *other, double (*q)[3], const double *x, const double *y,
                          const double *normal, double kept)
{
    double least = INFINITY;
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < m; ++k) {
            double off[3], apart = 0.0, rate = 0.0;
            minus(d, p[i], q[k], off);
            apart = dot(d, off, normal) - kept;
            for (int j = 0; j < d; ++j) {
                const int64_t a = (int64_t)d * one[i] + j, b = (int64_t)d * other[k] + j;
                rate += normal[j] * ((y[a] - x[a]) - (y[b] - x[b]));
            }
            if (!(apart > 0.0)) /* the normal is round-off */
                return 0.0;
            if (rate < 0.0)
                least = fmin(least, apart / -rate);
        }
    return least;
}

/* What a step keeps of a gap of which it may leave `kept`: no less than LEAST_GAP, unless it begins there. */
INLINE double kept_of(double gap, double kept, double dhat)
{
    const double least = LEAST_GAP * dhat;
    return kept < least && gap > (1.0 + LEAST_GAP) * least ? least : kept;
}

/* The longest step in [0, 1] along which a pair keeps the distance `kept`, by conservative advancement (Li et al. 2021, additive CCD). Bounded:
 * it ends early, with a smaller step, which is safe. `least` is a bound of the pair's distance; it is replaced by the distance where it does not
 * show that the pair keeps its own. Gives the pair's rate on this way, too. */
INLINE double advance(int d, int n, const int32_t *one, int m, const int32_t *other, const double *x, const double *y, double dhat, double gap_share,
                      double step, double *least, double *rate)
{
    double p[3][3], q[3][3], s, t;
    const double speed = approach(d, n, one, m, other, x, y);
    *rate = speed;
    if (ADVANCE * (*least - (gap_share + MARGIN) * dhat) >= step * speed)
        return step;
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
            *least = distance, kept = kept_of(distance, gap_share * fmin(distance, dhat), dhat);
        const double room = distance - kept;
        if (ADVANCE * room >= (step - at) * speed) /* its own end is no sooner: the least of many steps depends on no order */
            return step;
        if (round > 0 && room <= MARGIN * kept)
            return at;
        double longest = 0.0;
        if (3 * round >= MAX_ADVANCES) {
            double sides[2][3], normal[3], ways[3][2][3];
            int k = 0;
            for (int j = 0; j < d; ++j)
                normal[j] = n == 1 ? closest.gap[j] : (p[0][j] - q[0][j]) + s * (p[1][j] - p[0][j]) - t * (q[1][j] - q[0][j]);
            if (n == 1)
                for (; k + 1 < closest.kind; ++k)
                    minus(d, q[closest.corner[k + 1]], q[closest.corner[0]], sides[k]);
            if (n == 2 && s > 0.0 && s < 1.0)
                minus(d, p[1], p[0], sides[k++]);
            if (n == 2 && t > 0.0 && t < 1.0)
                minus(d, q[1], q[0], sides[k++]);
            if (d == 3 && k == 2) {
                for (int end = 0; end < 2; ++end) {
                    const double *z = end ? y : x, *a = z + 3 * one[0], *b = z + 3 * other[0];
                    minus(3, a, b, ways[0][end]), minus(3, z + 3 * (n == 1 ? other[2] : one[1]), n == 1 ? b : a, ways[1][end]);
                    minus(3, z + 3 * other[1], b, ways[2][end]);
                }
                longest = apart_by_volume(ways, at, step, kept) - at;
            } else {
                unit_across(d, k, sides, normal);
                longest = ADVANCE * apart_along(d, n, one, p, m, other, q, x, y, normal, kept);
            }
            if (longest >= step - at)
                return step;
        }
        at += fmax(longest, ADVANCE * room / speed);
    }
    return at;
}

/* The longest step in [0, 1] from x towards y after which each pair has kept at least the share `gap_share` of its gap, or of dhat. Bounds, if there
 * are some, become those of the way from x to y. */
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share, const pairs_t *pairs, double step)
{
    const int d = s->d, bounded = pairs->begin != 0;
    const place_t place = bounded ? place_of(s, pairs, x) : (place_t){0.0, 0.0};
    double rate;
    for (int64_t k = 0; k < pairs->n_points; ++k) {
        const int32_t *pair = pairs->points + 2 * k, *facet = s->facet + (int64_t)d * pair[1];
        double least = bounded ? left(place, pairs->point_bounds[k], pairs->point_rates[k]) : 0.0;
        step = d == 3 ? advance(3, 1, pair, 3, facet, x, y, dhat, gap_share, step, &least, &rate)
                      : advance(2, 1, pair, 2, facet, x, y, dhat, gap_share, step, &least, &rate);
        if (bounded)
            pairs->point_bounds[k] = least, pairs->point_rates[k] = rate;
    }
    for (int64_t k = 0; k < pairs->n_edges; ++k) {
        const int32_t *pair = pairs->edges + 2 * k, *one = s->edge + 2 * (int64_t)pair[0], *other = s->edge + 2 * (int64_t)pair[1];
        double least = bounded ? left(place, pairs->edge_bounds[k], pairs->edge_rates[k]) : 0.0;
        step = advance(3, 2, one, 2, other, x, y, dhat, gap_share, step, &least, &rate);
        if (bounded)
            pairs->edge_bounds[k] = least, pairs->edge_rates[k] = rate;
    }
    return step;
}

/* The same of this rank's vertices and half-spaces, of each gap alone. Gaps are taken to close at a constant rate: exact where planes do not turn. */
double half_space_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share)
{
    const int d = s->d;
    double step = 1.0;
    for (int64_t plane = 0; plane < s->planes; ++plane) {
        const int64_t frame = d * (s->vertices + (d + 1) * plane);
        double before[3], after[3], from[3], to[3];
        minus(d, x + frame + d, x + frame, before), minus(d, y + frame + d, y + frame, after);
        for (int64_t v = 0; v < s->vertices; ++v) {
            if (s->owned[v] != 1)
                continue;
            minus(d, x + d * v, x + frame, from), minus(d, y + d * v, y + frame, to);
            const double gap = dot(d, from, before), approach = gap - dot(d, to, after);
            const double kept = gap_share * gap, least = kept_of(gap, kept, dhat);
            const double most = least > kept ? gap - least : (1.0 - gap_share) * fmax(gap, 0.0);
            if (approach > 0.0 && most < step * approach)
                step = most / approach;
        }
    }
    return step;
}

/* Pairs that meet on the way: kinds of them. */
enum { POINT, EDGES, PLANE };

/* Adds the meeting of two primitives, of n and m vertices, at a share of the way. */
INLINE void add_meeting(const surface_t *s, int d, int n, const int32_t *one, int m, const int32_t *other, const double *x, const double *y, double time,
                        double distance, double weight, int64_t room, int64_t *count, meeting_t *out)
{
    double p[2][3], q[3][3], gap[3], c[4] = {0.0};
    const double *corners[3] = {q[0], q[1], q[2]};
    const int64_t k = (*count)++;
    if (k >= room)
        return;
    meeting_t *to = out + k;
    for (int i = 0; i < 4; ++i)
        to->vertices[i] = i < n ? one[i] : i < n + m ? other[i - n] : one[0];
    for (int j = 0; j < d; ++j) {
        for (int i = 0; i < n; ++i)
            p[i][j] = x[(int64_t)d * one[i] + j] + time * (y[(int64_t)d * one[i] + j] - x[(int64_t)d * one[i] + j]);
        for (int i = 0; i < m; ++i)
            q[i][j] = x[(int64_t)d * other[i] + j] + time * (y[(int64_t)d * other[i] + j] - x[(int64_t)d * other[i] + j]);
    }
    if (n == 1) {
        closest_t at;
        to_facet(d, p[0], corners, &at);
        c[0] = 1.0;
        for (int i = 0; i < at.kind; ++i)
            c[1 + at.corner[i]] = -at.share[i];
    } else {
        double a, b;
        between_segments(p[0], p[1], q[0], q[1], &a, &b);
        c[0] = 1.0 - a, c[1] = a, c[2] = b - 1.0, c[3] = -b;
    }
    for (int j = 0; j < d; ++j) {
        gap[j] = 0.0;
        for (int i = 0; i < n + m; ++i)
            gap[j] += c[i] * (i < n ? p[i][j] : q[i - n][j]);
    }
    const double size = fmax(sqrt(dot(d, gap, gap)), 1e-300);
    to->gap = 0.0;
    for (int j = 0; j < d; ++j) {
        to->normal[j] = gap[j] / size;
        for (int i = 0; i < 4; ++i)
            to->gap += to->normal[j] * c[i] * (s->owned[to->vertices[i]] < 0 ? y : x)[(int64_t)d * to->vertices[i] + j];
    }
    memcpy(to->coefficients, c, sizeof c);
    to->weight = weight, to->time = time, to->distance = distance, to->expected = 0.0;
}

/* The same of this rank's vertices and half-spaces. */
INLINE void plane_meetings(int d, const surface_t *s, const double *x, const double *y, double gap_share, int64_t room, int64_t *count, meeting_t *out)
{
    for (int64_t plane = 0; plane < s->planes; ++plane) {
        const int32_t origin = (int32_t)(s->vertices + (d + 1) * plane);
        double before[3], after[3], from[3], to[3], still[3];
        minus(d, x + (int64_t)d * (origin + 1), x + (int64_t)d * origin, before), minus(d, y + (int64_t)d * (origin + 1), y + (int64_t)d * origin, after);
        for (int32_t v = 0; v < s->vertices; ++v) {
            if (s->owned[v] != 1)
                continue;
            minus(d, x + (int64_t)d * v, x + (int64_t)d * origin, from), minus(d, y + (int64_t)d * v, x + (int64_t)d * v, to);
            minus(d, x + (int64_t)d * v, y + (int64_t)d * origin, still);
            const double gap = dot(d, from, before), left = dot(d, still, after); /* without the vertex's own motion */
            const double approach = gap - left - dot(d, to, after), most = (1.0 - gap_share) * fmax(gap, 0.0);
            if (!(approach > most))
                continue;
            const int64_t k = (*count)++;
            if (k >= room)
                continue;
            out[k] = (meeting_t){{PLANE, v, (int32_t)plane}, {v, origin, v, v}, {1.0, -1.0}, {0.0}, 2.0 * s->areas[v], most / approach, gap, left, 0.0};
            memcpy(out[k].normal, after, d * sizeof(double));
        }
    }
}

/* The pairs of n lists, and the half-spaces, that keep less than the share `gap_share` of their gap, or of dhat, on the way from x to y. Returns how
 * many, of which `room` are written. Bounds become those of the way. */
int64_t find_meetings(const surface_t *s, const double *x, const double *y, double dhat, double gap_share, int n, pairs_t *const *lists, int64_t room,
                      meeting_t *out)
{
    const int d = s->d;
    int64_t count = 0;
    if (d == 3)
        plane_meetings(3, s, x, y, gap_share, room, &count, out);
    else
        plane_meetings(2, s, x, y, gap_share, room, &count, out);
    for (int list = 0; list < n; ++list) {
        const pairs_t *pairs = lists[list];
        if (!pairs->n_points && !pairs->n_edges)
            continue;
        const place_t place = pairs->begin ? place_of(s, pairs, x) : (place_t){0.0, 0.0};
        for (int64_t k = 0; k < pairs->n_points; ++k) {
            const int32_t *pair = pairs->points + 2 * k, *facet = s->facet + (int64_t)d * pair[1];
            double least = pairs->begin ? left(place, pairs->point_bounds[k], pairs->point_rates[k]) : 0.0;
            const double time = d == 3 ? advance(3, 1, pair, 3, facet, x, y, dhat, gap_share, 1.0, &least, pairs->point_rates + k)
                                       : advance(2, 1, pair, 2, facet, x, y, dhat, gap_share, 1.0, &least, pairs->point_rates + k);
            pairs->point_bounds[k] = least;
            if (time == 1.0)
                continue;
            if (count < room)
                out[count].pair[0] = POINT, out[count].pair[1] = pair[0], out[count].pair[2] = pair[1];
            if (d == 3)
                add_meeting(s, 3, 1, pair, 3, facet, x, y, time, least, s->areas[pair[0]], room, &count, out);
            else
                add_meeting(s, 2, 1, pair, 2, facet, x, y, time, least, s->areas[pair[0]], room, &count, out);
        }
        for (int64_t k = 0; k < pairs->n_edges; ++k) {
            const int32_t *pair = pairs->edges + 2 * k, *one = s->edge + 2 * (int64_t)pair[0], *other = s->edge + 2 * (int64_t)pair[1];
            double least = pairs->begin ? left(place, pairs->edge_bounds[k], pairs->edge_rates[k]) : 0.0;
            const double time = advance(3, 2, one, 2, other, x, y, dhat, gap_share, 1.0, &least, pairs->edge_rates + k);
            pairs->edge_bounds[k] = least;
            if (time == 1.0)
                continue;
            if (count < room)
                out[count].pair[0] = EDGES, out[count].pair[1] = pair[0], out[count].pair[2] = pair[1];
            add_meeting(s, 3, 2, one, 2, other, x, y, time, least, fmin(s->edge_areas[pair[0]], s->edge_areas[pair[1]]), room, &count, out);
        }
    }
    return count;
}
