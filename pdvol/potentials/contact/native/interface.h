/* The structures and functions of contact that Python uses. C includes this file, and Python reads it (pdvol/compiled.py). */
#ifndef PDVOL_CONTACT_INTERFACE_H
#define PDVOL_CONTACT_INTERFACE_H
#include <stdint.h>

/* Primitives: edges and facets by their vertices, and a tree of boxes. Positions of a surface are those of its vertices and, behind them, a frame of
 * each half-space: a point on its plane, and from there the ends of its unit normal, which leads out of it, and of d - 1 unit tangents. */
typedef struct {
    int32_t d;
    int64_t vertices, edges, facets, objects, leaves, planes;
    const int32_t *edge, *facet, *facet_edges; /* (edges, 2); (facets, d); (facets, 3), in 3D alone */
    const int32_t *vertex_share, *edge_share;  /* how often unions of facets count a vertex and an edge: Surface in surface.py */
    const double *areas, *edge_areas;              /* weights of vertices and of edges [m^(d-1)] */
    const int32_t *skip, *leaf, *roots;        /* tree: next node outside of each node, its leaf or -1; (objects + 1) first nodes */
    const int32_t *leaf_facets, *leaf_vertices, *leaf_edges;                      /* leaf by leaf; each vertex and edge is in one leaf */
    const int32_t *leaf_facet_starts, *leaf_vertex_starts, *leaf_edge_starts; /* (leaves + 1) */
    const int8_t *owned;  /* (vertices): 1 of this rank, 0 of another one, -1 of an obstacle */
    const uint8_t *holds; /* nodes whose facets have vertices of this rank */
} surface_t;

/* Candidate pairs, of vertices and facets (a vertex's pairs stand together) and of edges. On the straight way of all vertices between two places a pair
 * is no nearer than its bound at the way's start less the share of the way times its rate. */
typedef struct {
    int64_t n_points, n_edges;
    const int32_t *points, *edges; /* two numbers each */
    double *point_bounds, *edge_bounds, *point_rates, *edge_rates;
    const double *begin, *end; /* of the way; no bounds are known without */
} pairs_t;

/* A contact: CONTACT in candidates.py. */
typedef struct {
    int32_t vertices[4];
    double coefficients[4], gap[3], weight, pressure;
    uint8_t counted;
} contact_t;

/* The derivatives of a weight that depends on positions: FADE in candidates.py. */
typedef struct {
    int64_t contact;
    double first[12], second[10][9];
} fade_t;

/* Contacts, those of half-spaces first, and the fades among them, both in one order. */
typedef struct {
    int64_t count, faded, half_spaces;
    contact_t *contacts;
    fade_t *fades;
} contacts_t;

/* Friction of lagged contacts: the surface's positions when the step began, the contacts' forces when they slide, and the slip [m] below which these
 * are smoothed; and, of contacts that are predicted to stick, force over slip per unit of sliding force [1/m], 0 of others. */
typedef struct {
    double eps;
    const double *start, *forces;
    double *sticks;
} friction_t;

/* A pair that a way would bring together: MEETING in candidates.py. Its gap is measured along the normal, and between the points, with which it meets. */
typedef struct {
    int32_t pair[3], vertices[4]; /* POINT, EDGES or PLANE, and the numbers of both */
    double coefficients[4], normal[3], weight;
    double time;     /* share of the way at which it meets */
    double distance; /* [m] at the way's start */
    double gap;      /* [m] with bodies at the way's start, obstacles at its end, as above */
    double expected; /* [m] gap at the way's end with the forces of contact; 0: it does not meet */
} meeting_t;

void fit_boxes(const surface_t *s, const uint8_t *marked, const double *x, const double *y, double *boxes);
void move_back(int d, int64_t objects, const int64_t *firsts, int turned, const double *start, double *vertices,
               double *turns);
double spare_room(int d, int64_t objects, const int64_t *firsts, const double *start, const double *move,
                  const double *vertices, const double *room);
int search_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance,
                 const uint8_t *meets, pairs_t *found, int32_t *points, int32_t *edges);
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share,
                    const pairs_t *pairs, double step);
double half_space_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share);
int64_t find_meetings(const surface_t *s, const double *x, const double *y, double dhat, double gap_share, int n,
                      pairs_t *const *lists, int64_t room, meeting_t *out);
int64_t expect_gaps(int d, int64_t count, meeting_t *meetings, const double *y, double dhat, double kappa,
                    double kept);
void meeting_gradient(int d, int64_t count, const meeting_t *meetings, double dhat, double kappa, double *gradient);
int64_t meeting_blocks(int d, int64_t count, const meeting_t *meetings, double dhat, double kappa, double factor,
                       const int64_t *rows, int64_t first, int64_t last, int64_t *out_rows, int64_t *out_columns,
                       double *blocks);
int find_contacts(const surface_t *s, const double *x, double dhat, double kappa, int n, pairs_t *const *lists,
                  const contacts_t *to, int64_t *counts, double *energy, double *gradient);
int64_t barrier_blocks(int d, const contacts_t *all, const double *x, double dhat, double kappa, double factor,
                       int convex, const int64_t *rows, int64_t first, int64_t last, int64_t *out_rows,
                       int64_t *out_columns, double *blocks);
int64_t sticking_blocks(int d, const contacts_t *all, double dhat, double kappa, double factor, const int64_t *rows,
                        int64_t first, int64_t last, int64_t *out_rows, int64_t *out_columns, double *blocks);
double friction_sum(int d, const contacts_t *all, const friction_t *friction, const double *x, int predicted,
                    double *gradient);
int64_t friction_blocks(int d, const contacts_t *all, const friction_t *friction, const double *x, double weight,
                        int projected, const int64_t *rows, int64_t first, int64_t last, int64_t *out_rows,
                        int64_t *out_columns, double *blocks);
int64_t friction_predict(int d, const contacts_t *all, const friction_t *friction, const double *now,
                         const double *then);
#endif
