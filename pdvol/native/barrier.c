/* The barrier over the contacts of a surface: the sum of its law, its gradient and the blocks of its Hessian. */
#include "products.h"

/* The barrier's law kappa dhat g(s), g(s) = -(s - 1)^2 ln s, s = (gap / dhat)^2, and its first two derivatives by gap^2; these are zero where there is
 * no gap. */
INLINE double law(double squared, double dhat, double kappa, double *slope, double *second)
{
    const double s = squared / (dhat * dhat);
    *slope = *second = 0.0;
    if (!(s > 0.0 && s < 1.0))
        return s > 0.0 ? 0.0 : INFINITY;
    const double logarithm = log(s), rest = s - 1.0;
    *slope = -kappa / dhat * rest * (2.0 * logarithm + rest / s);
    *second = -kappa / (dhat * dhat * dhat) * (2.0 * logarithm + 4.0 * rest / s - rest * rest / (s * s));
    return -kappa * dhat * rest * rest * logarithm;
}

/* The sum of weights times the law over contacts that count here, and of all contacts the pressures, minus the law's derivatives by the gap, and the
 * gradient by the surface's positions (n, d), added to `gradient`; of obstacles over those that count here. */
INLINE double sum(const contacts_t *all, double dhat, double kappa, double *gradient)
{
    double total = 0.0;
    for (int64_t k = 0, f = 0; k < all->count; ++k) {
        contact_t *at = all->contacts + k;
        const double *c = at->coefficients, squared = dot(at->gap, at->gap);
        double slope, second;
        const double value = law(squared, dhat, kappa, &slope, &second);
        total += at->counted ? at->weight * value : 0.0;
        at->pressure = -2.0 * sqrt(squared) * slope;
        for (int i = 0, n = used(c); i < n; ++i)
            for (int j = 0; j < d && adds(all, at, i); ++j)
                gradient[(int64_t)d * at->vertices[i] + j] += 2.0 * at->weight * slope * c[i] * at->gap[j];
        if (f == all->faded || all->fades[f].contact != k)
            continue;
        for (int q = 0; q < 4 * d; ++q)
            gradient[(int64_t)d * at->vertices[q / d] + q % d] += adds(all, at, q / d) ? value * all->fades[f].first[q] : 0.0;
        ++f;
    }
    return total;
}

/* What contact finds at positions x (n, d): the contacts nearer than dhat, of half-spaces and of the candidates of n lists (`active_contacts`), their
 * energy and its gradient (n, d). `to` has room for so many contacts as it counts. counts (3): how many there are, how many of them have weights
 * that depend on positions, and how many are half-spaces'; where there is no room for them, nothing else is found. Returns 1 without memory. */
int find_contacts(const surface_t *s, const double *x, double dhat, double kappa, int n, pairs_t *const *lists, const contacts_t *to, int64_t *counts,
                  double *energy, double *gradient)
{
    contacts_t found = *to;
    if (active_contacts(s, x, dhat, n, lists, &found))
        return 1;
    counts[0] = found.count, counts[1] = found.faded, counts[2] = found.half_spaces;
    if (found.count > to->count || found.faded > to->faded)
        return 0;
    memset(gradient, 0, d * (s->vertices + s->planes * (d + 1)) * sizeof(double));
    *energy = sum(&found, dhat, kappa, gradient);
    return 0;
}

/* The Hessian over a contact's n vertices of its weight times the law, or (`convex`) its convex part: the curvature along the gap and across it, where
 * they are positive, and of each parameter's u v' + v u' + v v' (`rotation`) one of two eigenvalues. */
INLINE void contact_hessian(int n, const double *c, const double *const *x, const double *gap, double weight, double dhat, double kappa, int convex,
                            blocks_t H)
{
    double slope, second, t[2][3], vector[12], u[2][12], v[2][12], edges[2][4] = OF_EDGES, facet[2][4] = {{0.0, 1.0, -1.0, 0.0}, {0.0, 1.0, 0.0, -1.0}};
    const double squared = dot(gap, gap);
    law(squared, dhat, kappa, &slope, &second);
    slope *= 2.0 * weight;
    const int of_edges = c[1] > 0.0, parameters = of_edges ? 2 : (c[2] != 0.0) + (c[3] != 0.0);
    rotation(parameters, c, of_edges ? edges : facet, x, gap, t, u, v);
    const double along = 4.0 * weight * second + slope / squared;
    outer(c, gap, vector);
    if (along > 0.0 || !convex)
        add_square(n, along, vector, H);
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
            outer(c, normal[e], vector);
            add_square(n, slope / dot(normal[e], normal[e]), vector, H);
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
            add_square(n, size / (uu * vv * vv + value * value * vv), vector, H);
        }
    }
}

/* The same of a vertex and a half-space, by the vertex alone: the law is convex in a gap that is linear. */
INLINE void half_space_hessian(const double *gap, double weight, double dhat, double kappa, blocks_t H)
{
    double slope, second;
    const double squared = dot(gap, gap);
    law(squared, dhat, kappa, &slope, &second);
    if (squared > 0.0)
        add_square(1, weight * (4.0 * second + 2.0 * slope / squared), gap, H);
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

/* Blocks of the Hessian of `factor` times the sum of weights times the law, or of its convex part, at positions x. */
void barrier_blocks(const contacts_t *all, const double *x, double dhat, double kappa, double factor, int convex, out_t *out)
{
    for (int64_t k = 0, f = 0; k < all->count; ++k) {
        blocks_t H = {{0.0}};
        const contact_t *contact = all->contacts + k;
        const int32_t *v = contact->vertices;
        const double *c = contact->coefficients, *gap = contact->gap, weight = factor * contact->weight, *at[4];
        const int fade = f < all->faded && all->fades[f].contact == k, n = k < all->half_spaces ? 1 : used(c);
        for (int i = 0; i < 4; ++i)
            at[i] = x + (int64_t)d * v[i];
        if (k < all->half_spaces)
            half_space_hessian(gap, weight, dhat, kappa, H);
        else if (n == 4)
            contact_hessian(4, c, at, gap, weight, dhat, kappa, convex && !fade, H);
        else if (n == 3)
            contact_hessian(3, c, at, gap, weight, dhat, kappa, convex, H);
        else
            contact_hessian(2, c, at, gap, weight, dhat, kappa, convex, H);
        if (fade) {
            double slope, second, force[12];
            const double energy = factor * law(dot(gap, gap), dhat, kappa, &slope, &second);
            for (int q = 0; q < 90; ++q)
                H[q / 9][q % 9] += energy * all->fades[f].second[q / 9][q % 9];
            outer(c, gap, force);
            add_product(4.0 * factor * slope, force, all->fades[f].first, H);
            if (convex)
                clamp_matrix(H);
            ++f;
        }
        for (int i = 0, row = 0; i < n; row += 4 - i++)
            for (int j = i, turned; j < n; ++j) {
                const double *block = H[row + j - i];
                double *to = c[i] * c[j] != 0.0 ? add_block(out, v[i], v[j], &turned) : 0;
                for (int p = 0; to && p < d; ++p)
                    for (int q = 0; q < d; ++q)
                        to[d * p + q] = block[turned ? d * q + p : d * p + q];
            }
    }
}

/* Blocks of `factor` times a tangential stiffness of contacts between bodies that equals the normal one (`ContactBarrier.add_sticking`). */
void sticking_blocks(const contacts_t *all, double dhat, double kappa, double factor, out_t *out)
{
    for (int64_t k = all->half_spaces; k < all->count; ++k) {
        const contact_t *at = all->contacts + k;
        const double *c = at->coefficients, *gap = at->gap, squared = dot(gap, gap);
        double slope, second, *to;
        int n = used(c), of_bodies = 1, turned;
        for (int i = 0; i < n; ++i)
            of_bodies = of_bodies && (c[i] == 0.0 || out->rows[at->vertices[i]] >= 0);
        if (!of_bodies)
            continue;
        law(squared, dhat, kappa, &slope, &second);
        const double stiffness = factor * at->weight * (2.0 * slope + 4.0 * squared * second);
        for (int i = 0; i < n && stiffness > 0.0; ++i)
            for (int j = i; j < n; ++j)
                if (c[i] * c[j] != 0.0 && (to = add_block(out, at->vertices[i], at->vertices[j], &turned)))
                    for (int p = 0; p < d * d; ++p)
                        to[p] = stiffness * c[i] * c[j] * ((p / d == p % d) - gap[p / d] * gap[p % d] / squared);
    }
}

/* A meeting's force along its normal [N] and its stiffness [N/m], by the law, with a gap. */
INLINE double force_of(const meeting_t *at, double gap, double dhat, double kappa, double *stiffness)
{
    double slope, second;
    law(gap * gap, dhat, kappa, &slope, &second);
    *stiffness = at->weight * (2.0 * slope + 4.0 * gap * gap * second);
    return -2.0 * at->weight * gap * slope;
}

/* Updates the expected gaps of meetings at the end of the direction, y being the end by the last expectations. A meeting is linearised at its
 * expected gap. The first one is `kept` times its present gap, or times dhat where that is less. The next one is the gap at which the law has the
 * force of the last tangent at y, but at least `kept` times the last one. It is not updated while it is right to within that factor. A pair whose
 * tangent pulls does not meet; out of reach, with its end within, it is expected half way there instead. Returns the number of changes. */
int64_t expect_gaps(int64_t count, meeting_t *meetings, const double *y, double dhat, double kappa, double kept)
{
    int64_t changed = 0;
    for (int64_t k = 0; k < count; ++k) {
        meeting_t *at = meetings + k;
        if (!(at->expected > 0.0)) {
            at->expected = kept * fmin(at->distance, dhat), ++changed;
            continue;
        }
        double gap = 0.0, stiffness, low = log(kept * at->expected), high = log(dhat);
        for (int i = 0; i < 4; ++i)
            gap += at->coefficients[i] * dot(at->normal, y + (int64_t)d * at->vertices[i]);
        const double force = force_of(at, at->expected, dhat, kappa, &stiffness) + stiffness * (at->expected - gap);
        if (force > 0.0 && fabs(gap - at->expected) <= kept * at->expected)
            continue;
        while (force > 0.0 && high - low > (1.0 - kept) / 16.0) {
            const double middle = 0.5 * (low + high);
            *(force_of(at, exp(middle), dhat, kappa, &stiffness) > force ? &low : &high) = middle;
        }
        at->expected = force > 0.0 ? exp(0.5 * (low + high)) : at->distance > dhat && gap < dhat ? sqrt(at->expected * gap) : 0.0, ++changed;
    }
    return changed;
}

/* What meetings add to the gradient at the way's start: of tangents at expected gaps, less that of the law at the present gap. */
void meeting_gradient(int64_t count, const meeting_t *meetings, double dhat, double kappa, double *gradient)
{
    for (int64_t k = 0; k < count; ++k) {
        const meeting_t *at = meetings + k;
        double stiffness, unused;
        const double force = force_of(at, at->expected, dhat, kappa, &stiffness), now = force_of(at, at->distance, dhat, kappa, &unused);
        const double slope = stiffness * (at->gap - at->expected) - force + now;
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                gradient[(int64_t)d * at->vertices[i] + j] += slope * at->coefficients[i] * at->normal[j];
    }
}

/* The same of the Hessian, never negative: blocks of `factor` times it. */
void meeting_blocks(int64_t count, const meeting_t *meetings, double dhat, double kappa, double factor, out_t *out)
{
    for (int64_t k = 0; k < count; ++k) {
        const meeting_t *at = meetings + k;
        double stiffness, now, *to;
        force_of(at, at->expected, dhat, kappa, &stiffness), force_of(at, at->distance, dhat, kappa, &now);
        const double more = factor * fmax(stiffness - now, 0.0), *c = at->coefficients;
        for (int i = 0, n = used(c), turned; i < n; ++i)
            for (int j = i; j < n; ++j)
                if (c[i] * c[j] != 0.0 && (to = add_block(out, at->vertices[i], at->vertices[j], &turned)))
                    for (int p = 0; p < d * d; ++p)
                        to[p] = more * c[i] * c[j] * at->normal[p / d] * at->normal[p % d];
    }
}
