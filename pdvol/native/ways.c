/* What happens on the straight way of all vertices from x to y: the longest step that keeps distances, and the pairs that meet. */
#include "advance.h"

/* The longest step in [0, 1] from x towards y after which each pair has kept at least the share `gap_share` of its gap, or of dhat. Bounds, if there
 * are some, become those of the way from x to y. */
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share, const pairs_t *pairs, double step)
{
    const int bounded = pairs->begin != 0;
    const place_t place = bounded ? place_of(s, pairs, x) : (place_t){0.0, 0.0};
    double rate;
    for (int64_t k = 0; k < pairs->n_points; ++k) {
        const int32_t *pair = pairs->points + 2 * k, *facet = s->facet + (int64_t)d * pair[1];
        double least = bounded ? left(place, pairs->point_bounds[k], pairs->point_rates[k]) : 0.0;
        step = advance(1, pair, d, facet, x, y, dhat, gap_share, step, &least, &rate);
        if (bounded)
            pairs->point_bounds[k] = least, pairs->point_rates[k] = rate;
    }
    for (int64_t k = 0; k < pairs->n_edges; ++k) {
        const int32_t *pair = pairs->edges + 2 * k, *one = s->edge + 2 * (int64_t)pair[0], *other = s->edge + 2 * (int64_t)pair[1];
        double least = bounded ? left(place, pairs->edge_bounds[k], pairs->edge_rates[k]) : 0.0;
        step = advance(2, one, 2, other, x, y, dhat, gap_share, step, &least, &rate);
        if (bounded)
            pairs->edge_bounds[k] = least, pairs->edge_rates[k] = rate;
    }
    return step;
}

/* The same of this rank's vertices and half-spaces, of each gap alone. Gaps are taken to close at a constant rate: exact where planes do not turn. */
double half_space_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share)
{
    double step = 1.0;
    for (int64_t plane = 0; plane < s->planes; ++plane) {
        const int64_t frame = d * (s->vertices + (d + 1) * plane);
        double before[3], after[3], from[3], to[3];
        minus(x + frame + d, x + frame, before), minus(y + frame + d, y + frame, after);
        for (int64_t v = 0; v < s->vertices; ++v) {
            if (s->owned[v] != 1)
                continue;
            minus(x + d * v, x + frame, from), minus(y + d * v, y + frame, to);
            const double gap = dot(from, before), approach = gap - dot(to, after);
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
INLINE void add_meeting(const surface_t *s, int32_t kind, const int32_t *pair, int n, const int32_t *one, int m, const int32_t *other, const double *x,
                        const double *y, double time, double distance, double weight, int64_t room, int64_t *count, meeting_t *out)
{
    double p[2][3], q[3][3], gap[3], c[4] = {0.0};
    const double *corners[3] = {q[0], q[1], q[2]};
    const int64_t k = (*count)++;
    if (k >= room)
        return;
    meeting_t *to = out + k;
    to->pair[0] = kind, to->pair[1] = pair[0], to->pair[2] = pair[1];
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
        to_facet(p[0], corners, &at);
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
    const double size = fmax(sqrt(dot(gap, gap)), 1e-300);
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
INLINE void plane_meetings(const surface_t *s, const double *x, const double *y, double gap_share, int64_t room, int64_t *count, meeting_t *out)
{
    for (int64_t plane = 0; plane < s->planes; ++plane) {
        const int32_t origin = (int32_t)(s->vertices + (d + 1) * plane);
        double before[3], after[3], from[3], to[3], still[3];
        minus(x + (int64_t)d * (origin + 1), x + (int64_t)d * origin, before), minus(y + (int64_t)d * (origin + 1), y + (int64_t)d * origin, after);
        for (int32_t v = 0; v < s->vertices; ++v) {
            if (s->owned[v] != 1)
                continue;
            minus(x + (int64_t)d * v, x + (int64_t)d * origin, from), minus(y + (int64_t)d * v, x + (int64_t)d * v, to);
            minus(x + (int64_t)d * v, y + (int64_t)d * origin, still);
            const double gap = dot(from, before), left = dot(still, after); /* without the vertex's own motion */
            const double approach = gap - left - dot(to, after), most = (1.0 - gap_share) * fmax(gap, 0.0);
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
    int64_t count = 0;
    plane_meetings(s, x, y, gap_share, room, &count, out);
    for (int list = 0; list < n; ++list) {
        const pairs_t *pairs = lists[list];
        if (!pairs->n_points && !pairs->n_edges)
            continue;
        const place_t place = pairs->begin ? place_of(s, pairs, x) : (place_t){0.0, 0.0};
        for (int64_t k = 0; k < pairs->n_points; ++k) {
            const int32_t *pair = pairs->points + 2 * k, *facet = s->facet + (int64_t)d * pair[1];
            double least = pairs->begin ? left(place, pairs->point_bounds[k], pairs->point_rates[k]) : 0.0;
            const double time = advance(1, pair, d, facet, x, y, dhat, gap_share, 1.0, &least, pairs->point_rates + k);
            pairs->point_bounds[k] = least;
            if (time < 1.0)
                add_meeting(s, POINT, pair, 1, pair, d, facet, x, y, time, least, s->areas[pair[0]], room, &count, out);
        }
        for (int64_t k = 0; k < pairs->n_edges; ++k) {
            const int32_t *pair = pairs->edges + 2 * k, *one = s->edge + 2 * (int64_t)pair[0], *other = s->edge + 2 * (int64_t)pair[1];
            double least = pairs->begin ? left(place, pairs->edge_bounds[k], pairs->edge_rates[k]) : 0.0;
            const double time = advance(2, one, 2, other, x, y, dhat, gap_share, 1.0, &least, pairs->edge_rates + k);
            pairs->edge_bounds[k] = least;
            const double weight = fmin(s->edge_areas[pair[0]], s->edge_areas[pair[1]]);
            if (time < 1.0)
                add_meeting(s, EDGES, pair, 2, one, 2, other, x, y, time, least, weight, room, &count, out);
        }
    }
    return count;
}
