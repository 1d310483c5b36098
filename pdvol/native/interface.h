/* The structures and functions that Python uses. C includes this file by common.h, and Python reads it (pdvol/compiled.py). */
#pragma once
#include <stdint.h>

/* Rows of a matrix, block CSR with ascending columns, d x d blocks by rows. */
typedef struct {
    int32_t *starts, *columns;
    double *blocks;
} rows_t;

/* ---- assembly */

/* Domains, in each of which F is the sum over its vertices of x_a G_a': cells, or the cells around an edge. Domain k has the entries starts[k] to
 * starts[k + 1] of `vertices`, which says where its vertices are in arrays of vertices; without `starts` each has d + 1. `gradients` are the G_a (d
 * numbers) of all but its first vertex, whose own is minus their sum. The first `counted` domains count in sums of this rank. Where `ceiling` is
 * positive, the density is zero from that det F on, and LANES such domains side by side are left out. `oriented`: the energy is infinite unless
 * det F > 0 in all. */
typedef struct {
    int32_t oriented;
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
int64_t merge_pairs(int64_t rows, int64_t first, int64_t n, const rows_t *cells, int64_t pairs, const int64_t *pair_rows, const int64_t *pair_columns,
                    const double *pair_blocks, const uint8_t *fixed, const rows_t *to);

/* ---- contact */

/* Primitives: edges and facets by their vertices, and a tree of boxes. Positions of a surface are those of its vertices and, behind them, a frame of
 * each half-space: a point on its plane, and from there the ends of its unit normal, which leads out of it, and of d - 1 unit tangents. */
typedef struct {
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

/* Contacts, those of half-spaces first, and the fades among them, both in one order. Vertices below `of_bodies` are bodies', all others obstacles'. */
typedef struct {
    int64_t count, faded, half_spaces, of_bodies;
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

/* Blocks being found of vertices that have rows (`rows`, -1: none), on or right of the diagonal, in the rows from `first` to before `last`;
 * of two vertices of which another rank has one, also left of it. There is room for 10 blocks a contact, or a meeting. */
typedef struct {
    const int64_t *rows;
    int64_t first, last, count;
    int64_t *to_rows, *to_columns;
    double *blocks;
} out_t;

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
void move_back(int64_t objects, const int64_t *firsts, int turned, const double *start, double *vertices,
               double *turns);
double spare_room(int64_t objects, const int64_t *firsts, const double *start, const double *move,
                  const double *vertices, const double *room);
int search_pairs(const surface_t *s, const double *boxes, const double *x, const double *y, double distance,
                 const uint8_t *meets, pairs_t *found, int32_t *points, int32_t *edges);
double longest_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share,
                    const pairs_t *pairs, double step);
double half_space_step(const surface_t *s, const double *x, const double *y, double dhat, double gap_share);
int64_t find_meetings(const surface_t *s, const double *x, const double *y, double dhat, double gap_share, int n,
                      pairs_t *const *lists, int64_t room, meeting_t *out);
int64_t expect_gaps(int64_t count, meeting_t *meetings, const double *y, double dhat, double kappa,
                    double kept);
void meeting_gradient(int64_t count, const meeting_t *meetings, double dhat, double kappa, double *gradient);
void meeting_blocks(int64_t count, const meeting_t *meetings, double dhat, double kappa, double factor, out_t *out);
int find_contacts(const surface_t *s, const double *x, double dhat, double kappa, int n, pairs_t *const *lists,
                  const contacts_t *to, int64_t *counts, double *energy, double *gradient);
void barrier_blocks(const contacts_t *all, const double *x, double dhat, double kappa, double factor, int convex, out_t *out);
void sticking_blocks(const contacts_t *all, double dhat, double kappa, double factor, out_t *out);
double friction_sum(const contacts_t *all, const friction_t *friction, const double *x, int predicted,
                    double *gradient);
void friction_blocks(const contacts_t *all, const friction_t *friction, const double *x, double weight, int projected, out_t *out);
int64_t friction_predict(const contacts_t *all, const friction_t *friction, const double *now,
                         const double *then);

/* ---- the linear solver */

/* What a rank exchanges with others, and MPI's own functions and handles (messages.py): pointers or, with MPICH, ints in their place. */
typedef struct {
    void *comm, *numbers, *sum, *in_place;
    int (*all_reduce)(const void *mine, void *all, int count, void *type, void *op, void *comm);
    int (*all_to_all)(const void *mine, const int *counts, const int *starts, void *type, void *theirs, const int *their_counts,
                      const int *their_starts, void *their_type, void *comm);
    int32_t rows;                                /* own vertices that go to others, rank by rank */
    const int32_t *row;
    const int32_t *counts, *starts;              /* of numbers for each rank, and where they begin */
    const int32_t *their_counts, *their_starts;
    double *sent, *received;                     /* room for d numbers a row, and for each that comes */
} ranks_t;

/* This rank's rows of a symmetric matrix and of its preconditioner. */
typedef struct {
    int32_t count, others;                   /* owned vertices; those of other ranks in the factor, behind the owned ones */
    rows_t own;                              /* between owned vertices: the upper triangle, diagonal first */
    rows_t far;                              /* couplings with other ranks' vertices, numbered from 0 */
    rows_t between;                          /* (count + others) rows: couplings with `others`, and between these, diagonal first */
    const float *weights;                    /* of the owned vertices in the factors: 1 over the root of how many factors they are in */
    const ranks_t *overlap;                  /* the exchange of such vertices; NULL on one rank */
    int32_t *factor_starts, *factor_columns; /* of the factor, ordered as the matrix */
    float *factor;                           /* of incomplete_cholesky */
    int32_t nodes;                           /* coarse vertices; 0 for none */
    const int32_t *p_starts, *p_columns;     /* prolongation of the owned vertices */
    const double *p_weights;
    const double *band;                      /* columns (nodes d, width) of the factor L of P' A P = L L', each from the diagonal down */
    int32_t width;                           /* a multiple of four; what is left of a column is zero */
    const ranks_t *ranks;                    /* NULL on one rank */
} linear_system;

int incomplete_cholesky(const linear_system *system, double drop);
/* P' A P of this rank's rows of A, on or right of the diagonal. P: CSR over all vertices. Lists the blocks of nodes i >= j in `sums` under the keys
 * i nodes + j, and returns their number; room for as many as there are such keys. places (nodes, nodes): zeros at first. */
int64_t coarse_operator(int64_t rows, int64_t first, const rows_t *A, const int32_t *p_starts, const int32_t *p_columns, const double *p_weights,
                        int64_t nodes, int32_t *places, int64_t *keys, double *sums);
void split_rows(int64_t rows, int64_t first, const rows_t *all, const rows_t *own, const rows_t *far);
/* Numbers the vertices of other ranks in far.columns, in place, from 0 and rank by rank, and returns how many there are (-1: no memory left).
 * rows (as many as far blocks at most): for each rank the own vertices that are coupled with its, ascending; is_strong: whether by a block of at least
 * `strong` times the size of the diagonal block there. counts, their_counts (ranks): of `rows`, and of others' vertices. ends (ranks): of the ranks'
 * global numbers. number: -1 for each global number, before and after. */
int64_t border(const linear_system *system, double strong, int32_t ranks, const int64_t *ends, int32_t *number, int32_t *rows, uint8_t *is_strong,
               int32_t *counts, int32_t *their_counts);
/* What the other ranks' factors get of this one. For each rank numbers has the lengths of its rows, zero where a row is not strong, and columns
 * numbered within the strong ones; blocks the blocks between these, on or right of the diagonal. shared: the strong rows; weights (count) as in
 * linear_system. number: -1 for each own vertex, before and after. */
void pack_overlap(const linear_system *system, int32_t ranks, const int32_t *counts, const int32_t *rows, const uint8_t *is_strong, int32_t *number,
                  int32_t *numbers, double *blocks, int32_t *block_counts, int32_t *shared, int32_t *shared_counts, float *weights);
/* What came of others' pack_overlap as `between` of linear_system, with room for all far blocks and those that came; shared_counts (ranks): of vertices
 * in the factor. Returns 1 if memory ran out. */
int unpack_overlap(const linear_system *system, int32_t ranks, const int32_t *counts, const int32_t *block_counts, const int32_t *numbers,
                   const double *blocks, int32_t *shared_counts, const rows_t *between);
int symmetric_product(const linear_system *system, const double *x, double *y);
int conjugate_gradients(const linear_system *system, const double *right, const double *start, double tolerance,
                        int32_t most, double *solution, int32_t *iterations);
/* z (count + others, 4) = (R' R)^-1 z. */
void precondition_locally(const linear_system *system, float *z);
/* Adds P (P' A P)^-1 P' residual (count, 4) to z (count, 4); x: room for nodes d + width numbers. */
void add_coarse_correction(const linear_system *system, const double *residual, double *x, float *z);
