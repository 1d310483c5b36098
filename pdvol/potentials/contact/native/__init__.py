"""The compiled loops of contact: broad phase, collision detection, active pairs, sums over them, and friction."""

from functools import cache
from pathlib import Path
from typing import Any

from pdvol.compiled import ffi, load

__all__ = ["ffi", "library"]

ffi.cdef(
    """
typedef struct {
    int32_t d;
    int64_t vertices, edges, facets, objects, leaves;
    const int32_t *edge, *facet, *facet_edges;
    const int32_t *vertex_share, *edge_share;
    const double *areas, *edge_areas;
    const int32_t *skip, *leaf, *roots;
    const int32_t *leaf_facets, *leaf_vertices, *leaf_edges;
    const int32_t *leaf_facet_starts, *leaf_vertex_starts, *leaf_edge_starts;
} surface_t;
void fit_boxes(const surface_t *s, const uint8_t *marked, const double *x, const double *y, double *boxes);
void deviations(int d, int64_t objects, const int64_t *firsts, const double *start, const double *move,
                const double *vertices, double *drift, double *sizes);
void shapes(int d, int64_t bodies, const int64_t *firsts, const double *start, const double *move,
            const double *vertices, double *turns, double *shares, double *sizes, double *moves);
typedef struct {
    int64_t n_points, n_edges;
    const int32_t *points, *edges;
    double *point_bounds, *edge_bounds, *point_rates, *edge_rates;
    double share, off;
} pairs_t;
typedef struct {
    int64_t count, faded;
    int32_t *vertices;
    double *coefficients, *gaps, *weights;
    int64_t *fading;
    double *fades, *curves;
} contacts_t;
int search_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance,
                 const uint8_t *meets, int64_t first, int64_t last, pairs_t *found, int32_t *points, int32_t *edges);
void ask_about(int d, int64_t n, const double *x, const double *y, const double *z, pairs_t *pairs);
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share,
                    const pairs_t *pairs, double step);
int active_pairs(const surface_t *s, const double *x, double dhat, int n, pairs_t *const *lists, const contacts_t *to,
                 int64_t *counts);
double barrier_sum(int d, const contacts_t *all, double dhat, double kappa, double *gradient);
int64_t tensor_blocks(int d, const contacts_t *all, const double *tensors, const int64_t *rows, int64_t first,
                      int64_t last, int64_t *out_rows, int64_t *out_columns, double *blocks);
int64_t barrier_blocks(int d, const contacts_t *all, const double *x, double dhat, double kappa, double factor,
                       int convex, const int64_t *rows, int64_t first, int64_t last, int64_t *out_rows,
                       int64_t *out_columns, double *blocks);
void friction_slips(int d, const contacts_t *all, const double *normals, const double *start, const double *x,
                    double *slips);
void friction_energies(int d, int64_t count, const double *slips, double eps, double *energies);
void friction_forces(int d, int64_t count, const double *slips, const double *sliding, double eps,
                     const int8_t *states, const double *ways, const double *sizes, double *forces);
void friction_tensors(int d, int64_t count, const double *slips, const double *normals, const double *sliding,
                      double eps, double weight, const int8_t *states, const double *ways, const double *sizes,
                      double *tensors);
int64_t friction_predict(int d, int64_t count, const double *now, const double *then, const double *sliding,
                         double eps, int8_t *states, double *ways, double *sizes);
void scatter(int d, const contacts_t *all, const double *forces, double *out);
"""
)


@cache
def library() -> Any:
    """The loaded library."""
    return load(Path(__file__).parent)
