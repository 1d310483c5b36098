/* One of the domains of an energy: how kernels are called on it, its vertices, its F, and how a Hessian over F becomes blocks between its vertices. */
#pragma once
#include "positive.h"

/* Numbers of as many domains side by side. LANES and AHEAD come from the compiler's command line (__init__.py). */
typedef double lanes __attribute__((vector_size(LANES * sizeof(double))));
typedef int64_t mask __attribute__((vector_size(LANES * sizeof(int64_t))));

INLINE lanes all(double a)
{
    lanes r;
    for (int l = 0; l < LANES; ++l)
        r[l] = a;
    return r;
}

INLINE lanes choose(mask m, lanes yes, lanes no)
{
    return (lanes)(((mask)yes & m) | ((mask)no & ~m));
}

INLINE lanes magnitude(lanes a)
{
    return choose(a < all(0.0), -a, a);
}

/* A compiled kernel (kernels.py): A from w, for all lanes. */
#define CALL(kernel, A, w) ((void (*)(double *, const double *))(kernel))((double *)(A), (const double *)(w))

/* Calls function(cells, ...) with whether all domains are cells as a constant: then loops over vertices unroll. */
#define EACH(domains, function, ...) ((domains)->starts ? function(0, domains, __VA_ARGS__) : function(1, domains, __VA_ARGS__))

/* Its number of vertices, where they are, and the gradients of all but the first. */
typedef struct {
    int64_t n;
    const int32_t *vertices;
    const double *gradients;
} domain_t;

INLINE domain_t domain_at(int cells, const domains_t *domains, int64_t k)
{
    const int64_t first = cells ? k * (d + 1) : domains->starts[k];
    return (domain_t){cells ? d + 1 : domains->starts[k + 1] - first, domains->vertices + first, domains->gradients + (first - k) * d};
}

typedef double four __attribute__((vector_size(32), aligned(8), may_alias));
typedef int64_t places __attribute__((vector_size(32)));

/* Eight numbers in as many registers as they need: GCC takes memory for vectors that no register holds, and a Hessian then takes 4 times as long. */
enum { FOURS = 2 };
typedef struct {
    four part[FOURS];
} eight;

INLINE eight times(double a, eight x)
{
    for (int i = 0; i < FOURS; ++i)
        x.part[i] *= a;
    return x;
}

INLINE eight plus(eight x, eight y)
{
    for (int i = 0; i < FOURS; ++i)
        x.part[i] += y.part[i];
    return x;
}

/* A vertex's numbers, and zeros behind them. */
INLINE four vertex(const double *v)
{
    return d == 3 ? (four){v[0], v[1], v[2]} : (four){v[0], v[1]};
}

/* The sum over a domain's vertices of v_a G_a' (d x d): F where v is x. Differences come first, which keeps a small domain's F exact. */
INLINE void gradient_of(domain_t domain, const double *v, double *F)
{
    const four v0 = vertex(v + (int64_t)domain.vertices[0] * d);
    four columns[3] = {{0.0}};
    for (int64_t i = 0; i < domain.n - 1; ++i) {
        const four along = vertex(v + (int64_t)domain.vertices[i + 1] * d) - v0;
        for (int j = 0; j < d; ++j)
            columns[j] += along * domain.gradients[i * d + j];
    }
    for (int a = 0; a < d; ++a)
        for (int j = 0; j < d; ++j)
            F[a * d + j] = columns[j][a];
}

/* How many domains there are from `first` on, of `count`: at most as many as lanes. */
INLINE int lanes_used(int64_t count, int64_t first)
{
    return count - first < LANES ? (int)(count - first) : LANES;
}

/* The domain of a lane, from `first` on; the last one again where there is none. */
INLINE domain_t domain_in(int cells, const domains_t *domains, int64_t first, int lane)
{
    return domain_at(cells, domains, first + lane < domains->count ? first + lane : domains->count - 1);
}

/* F of the domains from `first` on. */
INLINE void gradients_of(int cells, const domains_t *domains, int64_t first, const double *v, lanes *F)
{
    for (int l = 0; l < LANES; ++l) {
        double one[9];
        gradient_of(domain_in(cells, domains, first, l), v, one);
        for (int a = 0; a < d * d; ++a)
            F[a][l] = one[a];
    }
}

/* The volumes of the domains from `first` on. */
INLINE lanes volumes_of(const domains_t *domains, int64_t first)
{
    lanes volume = {0.0};
    for (int l = 0; l < lanes_used(domains->count, first); ++l)
        volume[l] = domains->volumes[first + l];
    return volume;
}

/* What a density's kernel takes: the parameters of the domains from `first` on, with its argument (k numbers) in between. */
INLINE void coefficients(const density_t *density, int64_t first, int k, const lanes *argument, lanes *w)
{
    const int np = density->np, before = density->at < 0 ? np : density->at;
    const double *own = density->parameters + first * np;
    memcpy(w, own, before * sizeof(lanes));
    if (density->at < 0)
        return;
    memcpy(w + before, argument, k * sizeof(lanes));
    memcpy(w + before + k, own + before * LANES, (np - before) * sizeof(lanes));
}

/* The gradient of a domain's first vertex. */
INLINE void first_gradient(domain_t domain, double *g)
{
    for (int j = 0; j < d; ++j)
        g[j] = 0.0;
    for (int64_t i = 0; i < domain.n - 1; ++i)
        for (int j = 0; j < d; ++j)
            g[j] -= domain.gradients[i * d + j];
}

/* A d x d block in its rows' order: the first eight numbers, of which 2D needs four, and the last one of 3D. */
typedef struct {
    eight head;
    double tail;
} block_t;

/* Adds a domain's Hessian to the blocks `out`: H is that over F, block H[j][m] between its columns j and m. `slot` has one entry per pair of vertices,
 * the first not behind the second: s >= 0 adds block s as it is, s <= -2 transposed at -2 - s, -1 nowhere. Returns the next domain's slots. */
INLINE const int32_t *add_blocks(int cells, domain_t domain, block_t H[3][3], const int32_t *slot, double *out)
{
    double first[3];
    first_gradient(domain, first);
    for (int64_t i = 0; i < domain.n; ++i) {
        const double *gi = i ? domain.gradients + (i - 1) * d : first;
        block_t T[3]; /* H contracted with g_i on the left */
        for (int m = 0; m < d; ++m) {
            T[m].head = plus(times(gi[0], H[0][m].head), times(gi[1], H[1][m].head));
            if (d == 3) {
                T[m].head = plus(T[m].head, times(gi[2], H[2][m].head));
                T[m].tail = gi[0] * H[0][m].tail + gi[1] * H[1][m].tail + gi[2] * H[2][m].tail;
            }
        }
        for (int64_t l = i; l < domain.n; ++l, ++slot) {
            const double *gl = l ? domain.gradients + (l - 1) * d : first;
            const double *ahead = out + (int64_t)(slot[AHEAD] < 0 ? 0 : slot[AHEAD]) * d * d;
            __builtin_prefetch(ahead, 1), __builtin_prefetch(ahead + d * d - 1, 1);
            if (*slot == -1)
                continue;
            const int turned = *slot < 0;
            double *to = out + (int64_t)(turned ? -2 - *slot : *slot) * d * d;
            eight head = plus(times(gl[0], T[0].head), times(gl[1], T[1].head));
            if (d == 3)
                head = plus(head, times(gl[2], T[2].head));
            const four a = head.part[0], b = head.part[1];
            const eight other = {{d == 3 ? (four){a[0], a[3], b[2], a[1]} : (four){a[0], a[2], a[1], a[3]}, {b[0], b[3], a[2], b[1]}}};
            if (cells) { /* without a branch: about every second block is turned */
                const places yes = (places){} - turned;
                for (int p = 0; p < FOURS; ++p)
                    head.part[p] = (four)(((places)other.part[p] & yes) | ((places)head.part[p] & ~yes));
            } else if (turned) {
                head = other;
            }
            *(four *)to += head.part[0];
            if (d == 3) {
                *(four *)(to + 4) += head.part[1];
                to[8] += gl[0] * T[0].tail + gl[1] * T[1].tail + gl[2] * T[2].tail;
            }
        }
    }
    return slot;
}
