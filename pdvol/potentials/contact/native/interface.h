/* The structures and functions of contact that Python uses. C includes this file, and Python reads it (pdvol/compiled.py). */
#ifndef PDVOL_CONTACT_INTERFACE_H
#define PDVOL_CONTACT_INTERFACE_H
#include <stdint.h>

/* Primitives: edges and facets by their vertices, and a tree of boxes. */
typedef struct {
    int32_t d;
    int64_t vertices, edges, facets, objects, leaves;
    const int32_t *edge, *facet, *facet_edges; /* (edges, 2); (facets, d); (facets, 3), in 3D alone */
    const int32_t *vertex_share, *edge_share;  /* how often unions of facets count a vertex and an edge: Surface in surface.py */
    const double *areas, *edge_areas;              /* weights of vertices and of edges [m^(d-1)] */
    const int32_t *skip, *leaf, *roots;        /* tree: next node outside of each node, its leaf or -1; (objects + 1) first nodes */
    const int32_t *leaf_facets, *leaf_vertices, *leaf_edges;                      /* leaf by leaf; each vertex and edge is in one leaf */
    const int32_t *leaf_facet_starts, *leaf_vertex_starts, *leaf_edge_starts; /* (leaves + 1) */
    const int8_t *owned;  /* (vertices): 1 of this rank, 0 of another one, -1 of an obstacle */
    const uint8_t *holds; /* nodes whose facets have vertices of this rank */
} surface_t;

/* Candidate pairs, of vertices and facets (a vertex's pairs stand together) and of edges. On a way of all vertices a pair is no nearer than its bound
 * at the way's start (0: none are known) less the share of the way times its rate; and no vertex is further than `off` from there. */
typedef struct {
    int64_t n_points, n_edges;
    const int32_t *points, *edges; /* two numbers each */
    double *point_bounds, *edge_bounds, *point_rates, *edge_rates;
    double share, off; /* of the place that is asked about */
} pairs_t;

/* Contacts, as class Stencils has them: up to four vertices each, their coefficients in the gap vector, a weight, and whether they count in this
 * rank's sums; in fades (faded, 12) and curves (faded, 10, 9: blocks on or right of the diagonal) the derivatives of those weights that depend on
 * positions. */
typedef struct {
    int64_t count, faded;
    int32_t *vertices;
    double *coefficients, *gaps, *weights;
    uint8_t *counted;
    int64_t *fading;
    double *fades, *curves;
} contacts_t;

void fit_boxes(const surface_t *s, const uint8_t *marked, const double *x, const double *y, double *boxes);
void deviations(int d, int64_t objects, const int64_t *firsts, const double *start, const double *move,
                const double *vertices, double *drift, double *sizes);
void shapes(int d, int64_t bodies, const uint8_t *wanted, const int64_t *firsts, const double *start,
            const double *move, const double *vertices, double *turns, double *shares, double *sizes, double *moves);
int search_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance,
                 const uint8_t *meets, pairs_t *found, int32_t *points, int32_t *edges);
void ask_about(int d, int64_t n, const double *x, const double *y, const double *z, pairs_t *pairs);
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share,
                    const pairs_t *pairs, double step);
int active_pairs(const surface_t *s, const double *x, double dhat, int n, pairs_t *const *lists, const contacts_t *to,
                 int64_t *counts);
void contact_pressures(int d, const contacts_t *all, double dhat, double kappa, double *pressures);
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
                      double eps, double weight, int projected, const int8_t *states, const double *ways,
                      const double *sizes, double *tensors);
int64_t friction_predict(int d, int64_t count, const double *now, const double *then, const double *sliding,
                         double eps, int8_t *states, double *ways, double *sizes);
int64_t plane_contacts(int d, int64_t planes, int64_t count, const int64_t *vertices, const double *x,
                       const double *normals, const double *offsets, double dhat, double *gaps, int64_t *plane,
                       int64_t *vertex, double *near);
double plane_law(int64_t count, const int64_t *vertex, const double *gaps, const double *weights, double dhat,
                 double kappa, double *forces, double *curvatures);
double plane_step(int d, int64_t planes, int64_t count, const int64_t *vertices, const double *x,
                  const double *direction, const double *normals, const double *offsets, const double *gaps,
                  double gap_share);
void scatter(int d, const contacts_t *all, const double *forces, double *out);
#endif
