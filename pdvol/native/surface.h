/* The primitives of a contact surface, and distances between them. Points have d = 2 or 3 numbers; facets are edges in 2D, triangles in 3D. */
#pragma once

#include "positive.h"

#define NEARLY_PARALLEL 1e-8 /* sin^2 of an angle: below it products of edges lose half of their digits */

#define MARGIN 1e-6 /* share of a distance that bounds and advances are not trusted with: bounds are lowered often, and steps end continuously */

INLINE double dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + (d == 3 ? a[2] * b[2] : 0.0);
}

INLINE void minus(const double *a, const double *b, double *out)
{
    for (int j = 0; j < d; ++j)
        out[j] = a[j] - b[j];
}

INLINE void cross(const double *a, const double *b, double *out)
{
    out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}

INLINE double clamp(double t)
{
    return t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t;
}

/* A primitive's closest point to a point: `kind` vertices of it (corners `corner`) with their shares. `gap` is the point minus the closest
 * one; returns |gap|^2. */
typedef struct {
    int kind, corner[3];
    double share[3], gap[3];
} closest_t;

INLINE double to_edge(const double *p, const double *a, const double *b, closest_t *c)
{
    double ab[3], ap[3];
    minus(b, a, ab), minus(p, a, ap);
    const double along = dot(ab, ap), size = dot(ab, ab);
    if (!(along > 0.0) || along >= size) {
        const int end = along > 0.0;
        c->kind = 1, c->corner[0] = end, c->share[0] = 1.0;
        minus(p, end ? b : a, c->gap);
    } else {
        const double t = along / size;
        c->kind = 2, c->corner[0] = 0, c->corner[1] = 1, c->share[0] = 1.0 - t, c->share[1] = t;
        for (int j = 0; j < d; ++j)
            c->gap[j] = ap[j] - t * ab[j];
    }
    return dot(c->gap, c->gap);
}

/* Of a triangle: inside it, or the closest of its edges' closest points. By the normal: round-off of dot products of sides would count 1 / sin^2 of
 * their angle times, and make the gap over a flat triangle too large. */
INLINE double to_triangle(const double *p, const double *const *x, closest_t *c)
{
    double u[3], v[3], w[3], n[3], across[3], along[3];
    minus(x[1], x[0], u), minus(x[2], x[0], v), minus(p, x[0], w);
    cross(u, v, n), cross(w, v, across), cross(u, w, along);
    const double det = dot(n, n), s = dot(across, n), t = dot(along, n);
    if (s > 0.0 && t > 0.0 && s + t < det) {
        const double a = s / det, b = t / det, height = dot(w, n) / det;
        c->kind = 3;
        for (int i = 0; i < 3; ++i)
            c->corner[i] = i;
        c->share[0] = 1.0 - a - b, c->share[1] = a, c->share[2] = b;
        for (int j = 0; j < 3; ++j)
            c->gap[j] = height * n[j];
        return dot(c->gap, c->gap);
    }
    double least = INFINITY;
    for (int i = 0; i < 3; ++i) {
        closest_t edge;
        const double distance = to_edge(p, x[i], x[(i + 1) % 3], &edge);
        if (distance < least) {
            least = distance, *c = edge;
            for (int k = 0; k < edge.kind; ++k)
                c->corner[k] = (i + edge.corner[k]) % 3;
        }
    }
    return least;
}

INLINE double to_facet(const double *p, const double *const *x, closest_t *c)
{
    return d == 3 ? to_triangle(p, x, c) : to_edge(p, x[0], x[1], c);
}

/* Closest points of two segments a, b and c, d: shares along both; returns the squared distance. Any pair of closest points of parallel ones. */
INLINE double between_segments(const double *a, const double *b, const double *c, const double *d, double *s, double *t)
{
    double u[3], v[3], w[3], gap[3];
    minus(b, a, u), minus(d, c, v), minus(c, a, w);
    const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
    const double det = uu * vv - uv * uv;
    *s = det > 0.0 ? clamp((uw * vv - vw * uv) / det) : 0.0;
    *t = (*s * uv - vw) / vv;
    if (!(*t > 0.0))
        *t = 0.0, *s = clamp(uw / uu);
    else if (*t > 1.0)
        *t = 1.0, *s = clamp((uw + uv) / uu);
    for (int j = 0; j < 3; ++j)
        gap[j] = *s * u[j] - w[j] - *t * v[j];
    double least = dot(gap, gap);
    if (det <= NEARLY_PARALLEL * uu * vv) { /* where the shares above are round-off: an end of one of them is closest, or nearly so */
        const double *ends[4] = {a, b, c, d};
        for (int i = 0; i < 4; ++i) {
            closest_t found;
            const double distance = to_edge(ends[i], i < 2 ? c : a, i < 2 ? d : b, &found);
            if (distance < least) {
                const double along = found.kind == 2 ? found.share[1] : found.corner[0];
                least = distance, *s = i < 2 ? i : along, *t = i < 2 ? along : i - 2;
            }
        }
    }
    return least;
}

/* Where a place is beside the straight way of a list's bounds: the share of the way that is nearest, and the largest distance of a vertex from there. */
typedef struct {
    double share, off;
} place_t;

INLINE place_t place_of(const surface_t *s, const pairs_t *pairs, const double *place)
{
    const double *x = pairs->begin, *y = pairs->end;
    double along = 0.0, size = 0.0, most = 0.0;
    for (int64_t k = 0; k < d * s->vertices; ++k)
        along += (place[k] - x[k]) * (y[k] - x[k]), size += (y[k] - x[k]) * (y[k] - x[k]);
    const double share = size > 0.0 ? clamp(along / size) : 0.0;
    for (int64_t k = 0; k < d * s->vertices; k += d) {
        double own = 0.0;
        for (int64_t j = k; j < k + d; ++j) {
            const double away = place[j] - x[j] - share * (y[j] - x[j]);
            own += away * away;
        }
        most = fmax(most, own == own ? own : INFINITY);
    }
    return (place_t){share, sqrt(most)};
}

/* What a pair's distance is at least at a place. */
INLINE double left(place_t place, double bound, double rate)
{
    return bound - place.share * rate - 2.0 * place.off;
}

/* Largest relative motion of two primitives, whose vertices move by y - x: their distance changes by no more. */
INLINE double approach(int n, const int32_t *one, int m, const int32_t *other, const double *x, const double *y)
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

int active_contacts(const surface_t *s, const double *x, double dhat, int n, pairs_t *const *lists, contacts_t *to);
