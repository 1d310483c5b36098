/* Lagged, smoothed Coulomb friction (Li et al. 2020, section 5) of k contacts: slips, energies, forces, stiffness, and the prediction of which
 * contacts stick (lagged_friction.py). The force grows to that of full sliding at a slip of eps, and is constant beyond. */
#include "surface.h"

enum { AS_IT_IS, STICKS, SLIDES };

#define LEAST_SLIDE 0.5 /* of eps: a contact predicted to slide sticks below this slip; between it and 1 the prediction stays as it is */

/* a.b, the middle numbers last: numpy's einsum adds in this order, and stored states were computed by it. */
INLINE double product(int d, const double *a, const double *b)
{
    return d == 3 ? (a[0] * b[0] + a[2] * b[2]) + a[1] * b[1] : a[0] * b[0] + a[1] * b[1];
}

INLINE double length(int d, const double *v)
{
    return sqrt(dot(d, v, v));
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

/* Slips (k, d) in the contacts' tangential planes, while the surface's vertices went from `start` to x. */
void friction_slips(int d, const contacts_t *all, const double *normals, const double *start, const double *x, double *slips)
{
    for (int64_t k = 0; k < all->count; ++k) {
        double u[3] = {0.0};
        for (int i = 0; i < 4; ++i) {
            const int64_t v = (int64_t)d * all->vertices[4 * k + i];
            for (int j = 0; j < d; ++j)
                u[j] += all->coefficients[4 * k + i] * (x[v + j] - start[v + j]);
        }
        const double along = product(d, u, normals + d * k);
        for (int j = 0; j < d; ++j)
            slips[d * k + j] = u[j] - along * normals[d * k + j];
    }
}

/* Dissipation (k) per unit of sliding force. */
void friction_energies(int d, int64_t count, const double *slips, double eps, double *energies)
{
    for (int64_t k = 0; k < count; ++k) {
        const double slip = length(d, slips + d * k);
        energies[k] = slip < eps ? slip * slip * (1.0 - slip / (3.0 * eps)) / eps + eps / 3.0 : slip;
    }
}

/* Forces (k, d) on the contacts from their sliding forces (k); where `states` are given, what these predicted states add to them. */
void friction_forces(int d, int64_t count, const double *slips, const double *sliding, double eps, const int8_t *states, const double *ways,
                     const double *sizes, double *forces)
{
    for (int64_t k = 0; k < count; ++k) {
        const double *slip = slips + d * k, *way = states ? ways + d * k : slip, over = force_over_slip(length(d, slip), eps);
        const double across = states ? 1.0 / fmax(sizes[k], eps) : 0.0, along = states ? product(d, slip, way) : 0.0;
        for (int j = 0; j < d; ++j) {
            double force = over * slip[j];
            if (states) {
                const double slides = way[j] + across * (slip[j] - along * way[j]);
                force = states[k] == AS_IT_IS ? 0.0 : (states[k] == STICKS ? 2.0 / eps * slip[j] : slides) - force;
            }
            forces[d * k + j] = sliding[k] * force;
        }
    }
}

/* `weight` times the stiffness (k, d, d) against the contacts' slips, in the predicted states where `states` are given. Forces of unions may be
 * negative; where `projected`, these have no stiffness. */
void friction_tensors(int d, int64_t count, const double *slips, const double *normals, const double *sliding, double eps, double weight,
                      int projected, const int8_t *states, const double *ways, const double *sizes, double *tensors)
{
    for (int64_t k = 0; k < count; ++k) {
        const int state = states ? states[k] : AS_IT_IS;
        const double *slip = state == SLIDES ? ways + d * k : slips + d * k, *normal = normals + d * k;
        const double size = length(d, slip), force = weight * (projected ? fmax(sliding[k], 0.0) : sliding[k]);
        double across = force_over_slip(size, eps), along = slope(size, eps), way[3];
        if (state == STICKS)
            across = along = 2.0 / eps;
        if (state == SLIDES)
            across = 1.0 / fmax(sizes[k], eps), along = 0.0;
        for (int j = 0; j < d; ++j)
            way[j] = slip[j] / fmax(size, 1e-300);
        for (int p = 0; p < d; ++p)
            for (int q = 0; q < d; ++q)
                tensors[d * (d * k + p) + q] = ((p == q) - normal[p] * normal[q]) * (force * across) + force * (along - across) * way[p] * way[q];
    }
}

/* Predicts the states of contacts whose slips go from `now` to `then`, from the states predicted last: `ways` (k, d) and `sizes` (k) are the slips'
 * at the end of those predicted to slide. Returns how many states have changed. */
int64_t friction_predict(int d, int64_t count, const double *now, const double *then, const double *sliding, double eps, int8_t *states,
                         double *ways, double *sizes)
{
    int64_t changed = 0;
    for (int64_t k = 0; k < count; ++k) {
        const double *end = then + d * k, size = length(d, end);
        double *way = ways + d * k;
        const int turned = product(d, states[k] == SLIDES ? way : now + d * k, end) < 0.0;
        int state = states[k];
        if (states[k] == AS_IT_IS && length(d, now + d * k) >= eps && (turned || size < eps))
            state = STICKS;
        if (states[k] == SLIDES && (turned || size < LEAST_SLIDE * eps))
            state = STICKS;
        if (states[k] == STICKS && size > eps)
            state = SLIDES;
        if (state == states[k] || !(sliding[k] > 0.0))
            continue;
        states[k] = state, ++changed;
        for (int j = 0; state == SLIDES && j < d; ++j)
            way[j] = end[j] / fmax(size, eps);
        if (state == SLIDES)
            sizes[k] = size;
    }
    return changed;
}

/* Forces (n, d) at the surface's vertices from forces (k, d) on the contacts' gaps, added to `out`. */
void scatter(int d, const contacts_t *all, const double *forces, double *out)
{
    for (int64_t k = 0; k < all->count; ++k)
        for (int i = 0; i < 4; ++i)
            for (int j = 0; j < d; ++j)
                out[(int64_t)d * all->vertices[4 * k + i] + j] += all->coefficients[4 * k + i] * forces[d * k + j];
}
