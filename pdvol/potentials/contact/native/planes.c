/* Vertices and half-spaces (planes.py): gaps, the barrier's law at contacts, and the largest step. */
#include "interface.h"
#include "law.h"

/* Distances (planes, count) of `count` vertices (rows of x) from planes: normals (planes, d) and offsets along them. Of those below dhat the plane, the
 * vertex and the distance; returns how many. */
int64_t plane_contacts(int d, int64_t planes, int64_t count, const int64_t *vertices, const double *x, const double *normals, const double *offsets,
                       double dhat, double *gaps, int64_t *plane, int64_t *vertex, double *near)
{
    int64_t found = 0;
    for (int64_t p = 0; p < planes; ++p)
        for (int64_t v = 0; v < count; ++v) {
            const double *at = x + d * vertices[v], *n = normals + d * p;
            double gap = -offsets[p];
            for (int j = 0; j < d; ++j)
                gap += n[j] * at[j];
            gaps[count * p + v] = gap;
            if (gap < dhat)
                plane[found] = p, vertex[found] = v, near[found++] = gap;
        }
    return found;
}

/* The sum of weights times the law over `count` contacts, and for each of them minus the derivative by the gap, and the second one. */
double plane_law(int64_t count, const int64_t *vertex, const double *gaps, const double *weights, double dhat, double kappa, double *forces,
                 double *curvatures)
{
    double total = 0.0;
    for (int64_t k = 0; k < count; ++k) {
        const double gap = gaps[k], weight = weights[vertex[k]];
        double slope = 0.0, second = 0.0;
        total += gap > 0.0 ? weight * law(gap * gap, dhat, kappa, &slope, &second) : INFINITY;
        forces[k] = -2.0 * weight * gap * slope;
        curvatures[k] = weight * (2.0 * slope + 4.0 * gap * gap * second);
    }
    return total;
}

/* The largest step in [0, 1] along `direction` at which each gap keeps the share `gap_share` of itself; planes as they are at the end of the step. */
double plane_step(int d, int64_t planes, int64_t count, const int64_t *vertices, const double *x, const double *direction, const double *normals,
                  const double *offsets, const double *gaps, double gap_share)
{
    double step = 1.0;
    for (int64_t p = 0; p < planes; ++p)
        for (int64_t v = 0; v < count; ++v) {
            const int64_t row = d * vertices[v];
            const double gap = gaps[count * p + v], *n = normals + d * p;
            double approach = gap + offsets[p];
            for (int j = 0; j < d; ++j)
                approach -= n[j] * (x[row + j] + direction[row + j]);
            const double most = (1.0 - gap_share) * (gap > 0.0 ? gap : 0.0);
            if (approach > 0.0 && most < step * approach)
                step = most / approach;
        }
    return step;
}
