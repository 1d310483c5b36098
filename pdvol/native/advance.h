/* How far a pair of primitives goes on its way without losing its distance: conservative advancement. */
#pragma once
#include "surface.h"

enum { MAX_ADVANCES = 1000 }; /* advances of one pair: bounds the time that it takes. After a third of them the pair slides, and its normal decides */
#define LEAST_GAP 1e-3         /* of dhat: steps leave it at least. There the barrier's pressure is 600 times the softest Young's modulus */
#define ADVANCE 0.9           /* share of the safe advance: the rest is for round-off */

/* The unit normal of a gap (d) whose closest points are free to slide along k sides: across these it has but round-off, which over the size of a
 * primitive is more than a small gap. */
INLINE void unit_across(int k, double (*sides)[3], double *gap)
{
    for (int i = 0; i < k; ++i) {
        const double share = dot(sides[i], gap) / dot(sides[i], sides[i]);
        for (int j = 0; j < d; ++j)
            gap[j] -= share * sides[i][j];
    }
    const double size = sqrt(dot(gap, gap));
    for (int j = 0; j < d; ++j)
        gap[j] /= size;
}

INLINE double volume(const double *a, const double *u, const double *v, double sign)
{
    double normal[3];
    cross(u, v, normal);
    return sign * dot(a, normal);
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
            area = fmax(area, sqrt(dot(products[k], products[k])));
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
INLINE double apart_along(int n, const int32_t *one, double (*p)[3], int m, const int32_t *other, double (*q)[3], const double *x, const double *y,
                          const double *normal, double kept)
{
    double least = INFINITY;
    for (int i = 0; i < n; ++i)
        for (int k = 0; k < m; ++k) {
            double off[3], apart = 0.0, rate = 0.0;
            minus(p[i], q[k], off);
            apart = dot(off, normal) - kept;
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
INLINE double advance(int n, const int32_t *one, int m, const int32_t *other, const double *x, const double *y, double dhat, double gap_share,
                      double step, double *least, double *rate)
{
    double p[3][3], q[3][3], s, t;
    const double speed = approach(n, one, m, other, x, y);
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
        const double distance = sqrt(n == 1 ? to_facet(p[0], corners, &closest) : between_segments(p[0], p[1], q[0], q[1], &s, &t));
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
                    minus(q[closest.corner[k + 1]], q[closest.corner[0]], sides[k]);
            if (n == 2 && s > 0.0 && s < 1.0)
                minus(p[1], p[0], sides[k++]);
            if (n == 2 && t > 0.0 && t < 1.0)
                minus(q[1], q[0], sides[k++]);
            if (d == 3 && k == 2) {
                for (int end = 0; end < 2; ++end) {
                    const double *z = end ? y : x, *a = z + 3 * one[0], *b = z + 3 * other[0];
                    minus(a, b, ways[0][end]), minus(z + 3 * (n == 1 ? other[2] : one[1]), n == 1 ? b : a, ways[1][end]);
                    minus(z + 3 * other[1], b, ways[2][end]);
                }
                longest = apart_by_volume(ways, at, step, kept) - at;
            } else {
                unit_across(k, sides, normal);
                longest = ADVANCE * apart_along(n, one, p, m, other, q, x, y, normal, kept);
            }
            if (longest >= step - at)
                return step;
        }
        at += fmax(longest, ADVANCE * room / speed);
    }
    return at;
}
