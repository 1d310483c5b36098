/* Lagged, smoothed Coulomb friction (Li et al. 2020, section 5) of contacts: energy, gradient, Hessian, and the prediction of which contacts stick
 * (friction.py). The force grows to that of full sliding at a slip of eps, and is constant beyond. */
#include "products.h"

INLINE double length(const double *v)
{
    return sqrt(dot(v, v));
}

/* Force over slip, per unit of sliding force; 2 / eps at zero slip. */
INLINE double force_over_slip(double slip, double eps)
{
    return slip < eps ? (2.0 - slip / eps) / eps : 1.0 / slip;
}

/* Derivative of the force by the slip: never negative, so that friction Hessians are positive semi-definite as they are. */
INLINE double slope(double slip, double eps)
{
    return slip < eps ? 2.0 * (1.0 - slip / eps) / eps : 0.0;
}

/* The slip (d) of a contact across its gap, while the surface went from `start` to x. */
INLINE void slip_of(const contact_t *contact, const double *start, const double *x, double *slip)
{
    const double *gap = contact->gap;
    double u[3] = {0.0};
    for (int i = 0; i < 4; ++i) {
        const int64_t v = (int64_t)d * contact->vertices[i];
        for (int j = 0; j < d; ++j)
            u[j] += contact->coefficients[i] * (x[v + j] - start[v + j]);
    }
    const double along = dot(u, gap) / dot(gap, gap);
    for (int j = 0; j < d; ++j)
        slip[j] = u[j] - along * gap[j];
}

/* The dissipation over the contacts that count here, and the gradient by the surface's positions (n, d), added to `gradient`; or, where `predicted`,
 * what those that are predicted to stick add to the gradient. */
double friction_sum(const contacts_t *all, const friction_t *friction, const double *x, int predicted, double *gradient)
{
    const double eps = friction->eps;
    double total = 0.0;
    for (int64_t k = 0; k < all->count; ++k) {
        const contact_t *contact = all->contacts + k;
        double slip[3], force[3];
        if (predicted && !friction->sticks[k])
            continue;
        slip_of(contact, friction->start, x, slip);
        const double size = length(slip), over = force_over_slip(size, eps);
        const double energy = size < eps ? size * size * (1.0 - size / (3.0 * eps)) / eps + eps / 3.0 : size;
        total += contact->counted ? friction->forces[k] * energy : 0.0;
        for (int j = 0; j < d; ++j)
            force[j] = friction->forces[k] * (predicted ? friction->sticks[k] - over : over) * slip[j];
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d && adds(all, contact, i); ++j)
                gradient[(int64_t)d * contact->vertices[i] + j] += contact->coefficients[i] * force[j];
    }
    return total;
}

/* Blocks of `weight` times the Hessian, with the predicted stiffness where a contact is predicted to stick. Forces of unions may be negative; where
 * `projected`, these have no stiffness. */
void friction_blocks(const contacts_t *all, const friction_t *friction, const double *x, double weight, int projected, out_t *out)
{
    for (int64_t k = 0; k < all->count; ++k) {
        const contact_t *contact = all->contacts + k;
        const int32_t *v = contact->vertices;
        const double *c = contact->coefficients, *gap = contact->gap, squared = dot(gap, gap);
        const double force = weight * (projected ? fmax(friction->forces[k], 0.0) : friction->forces[k]);
        double slip[3], way[3], T[9], *to;
        if (force == 0.0)
            continue;
        slip_of(contact, friction->start, x, slip);
        const double size = length(slip);
        double across = force_over_slip(size, friction->eps), along = slope(size, friction->eps);
        if (friction->sticks[k])
            across = along = friction->sticks[k];
        for (int j = 0; j < d; ++j)
            way[j] = slip[j] / fmax(size, 1e-300);
        for (int p = 0; p < d; ++p)
            for (int q = 0; q < d; ++q)
                T[d * p + q] = force * (((p == q) - gap[p] * gap[q] / squared) * across + (along - across) * way[p] * way[q]);
        for (int i = 0, n = used(c), turned; i < n; ++i)
            for (int j = i; j < n; ++j)
                if (c[i] * c[j] != 0.0 && (to = add_block(out, v[i], v[j], &turned)))
                    for (int p = 0; p < d * d; ++p)
                        to[p] = c[i] * c[j] * T[p];
    }
}

/* Predicts which contacts stick at the end of the way from `now` to `then`: those that slide now, and have turned round there or slip less than eps.
 * Their stiffness is the law's force over slip there, or that of small slips where they have turned round. Returns how many. */
int64_t friction_predict(const contacts_t *all, const friction_t *friction, const double *now, const double *then)
{
    const double eps = friction->eps;
    int64_t count = 0;
    for (int64_t k = 0; k < all->count; ++k) {
        double begin[3], end[3];
        slip_of(all->contacts + k, friction->start, now, begin), slip_of(all->contacts + k, friction->start, then, end);
        const int turned = dot(begin, end) < 0.0;
        const double left = length(end);
        const int sticks = friction->forces[k] > 0.0 && length(begin) >= eps && (turned || left < eps);
        friction->sticks[k] = sticks ? force_over_slip(turned ? 0.0 : left, eps) : 0.0;
        count += sticks;
    }
    return count;
}
