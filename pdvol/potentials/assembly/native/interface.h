/* The structures and functions of assembly that Python uses. C includes this file, and Python reads it (pdvol/compiled.py). */
#ifndef PDVOL_ASSEMBLY_INTERFACE_H
#define PDVOL_ASSEMBLY_INTERFACE_H
#include <stdint.h>

/* Domains, in each of which F is the sum over its vertices of x_a G_a': cells, or the cells around an edge. Domain k has the entries starts[k] to
 * starts[k + 1] of `vertices`, which says where its vertices are in arrays of vertices; without `starts` each has d + 1. `gradients` are the G_a (d
 * numbers) of all but its first vertex, whose own is minus their sum. The first `counted` domains count in sums of this rank. Where `ceiling` is
 * positive, the density is zero from that det F on, and LANES such domains side by side are left out. `oriented`: the energy is infinite unless
 * det F > 0 in all. */
typedef struct {
    int32_t d, oriented;
    int64_t count, counted;
    const int64_t *starts;
    const int32_t *vertices;
    const double *gradients, *volumes;
    double ceiling;
} domains_t;

/* A compiled kernel of a density psi or of its derivatives, and the domains' parameters (count / LANES, np, LANES), those of LANES domains side by
 * side. The kernel takes psi's argument, F or the three stretches, before parameter `at`, or not at all where `at` is negative. */
typedef struct {
    void *kernel;
    const double *parameters;
    int32_t np, at;
} density_t;

void domain_strains(const domains_t *domains, const double *x, double *out);
double domain_values(const domains_t *domains, const density_t *density, const double *x);
void domain_gradients(const domains_t *domains, const density_t *density, const double *x, double *out);
void domain_hessians(const domains_t *domains, const density_t *density, const double *x, const int32_t *slots,
                     int mode, double weight, double *out);
void isotropic_hessians(const domains_t *domains, const density_t *density, const density_t *second, const double *x,
                        const int32_t *slots, int mode, double weight, double *out);
void stretch_metrics(int64_t count, const double *C, double *out);
double volume_step(const domains_t *domains, const double *x, const double *p, double keep);
int64_t merge_pairs(int d, int64_t rows, int64_t first, int64_t n, const int32_t *cell_starts,
                    const int32_t *cell_columns, const double *cells, int64_t pairs, const int64_t *pair_rows,
                    const int64_t *pair_columns, const double *pair_blocks, const uint8_t *fixed, int32_t *starts,
                    int32_t *columns, double *blocks);
#endif
