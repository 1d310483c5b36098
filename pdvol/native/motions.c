/* How objects have moved as a whole, and how far their vertices are from that: what lists of pairs may leave out of their motion. */
#include "surface.h"

/* How vertices are away from the nearest place on the straight way from `start` by `move` (0: `start` itself): the mean vector of each object's
 * (`drift`), and the largest length of what is left without it (`sizes`). `firsts`: (objects + 1) where the objects' vertices begin. */
INLINE void deviations(int64_t objects, const int64_t *firsts, const double *start, const double *move, const double *vertices, double *drift,
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
 * place on the way from there by `move`. Negative where memory ran out, or a vertex is not a number. */
double spare_room(int64_t objects, const int64_t *firsts, const double *start, const double *move, const double *vertices, const double *room)
{
    double *drift = calloc(4 * objects + 1, sizeof(double)), *sizes = drift + 3 * objects, spare = drift ? INFINITY : -1.0;
    if (drift)
        deviations(objects, firsts, start, move, vertices, drift, sizes);
    for (int64_t one = 0; drift && one < objects; ++one)
        for (int64_t other = one; other < objects; ++other) {
            double size = 0.0;
            for (int j = 0; j < 3; ++j)
                size += (drift[3 * one + j] - drift[3 * other + j]) * (drift[3 * one + j] - drift[3 * other + j]);
            const double left = room[objects * one + other] - (sqrt(size) + sizes[one] + sizes[other]);
            spare = fmin(spare, isnan(left) ? -INFINITY : left);
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

/* Takes the rigid motion of each object since `start` from its vertices, or its shift alone where not `turned`. `turns` (objects, 3, 3): by how much
 * each was turned. */
void move_back(int64_t objects, const int64_t *firsts, int turned, const double *start, double *vertices, double *turns)
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
