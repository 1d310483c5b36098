/* CPU time that this process's thread spends in MPI, and the bytes it sends: preloaded before the MPI library, whose PMPI functions do the work.
 * MPI's handles are pointers or ints; both are passed on as they are. */
#define _GNU_SOURCE
#include <time.h>

typedef void *handle;
int PMPI_Type_size(handle, int *);
int PMPI_Comm_size(handle, int *);

static double inside = 0.0, bytes = 0.0, calls = 0.0;
static int depth = 0;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}

/* CPU time [s] in MPI, bytes sent and calls so far. */
void in_messages(double *out) { out[0] = inside, out[1] = bytes, out[2] = calls; }

static double size_of(handle type)
{
    int size = 0;
    PMPI_Type_size(type, &size);
    return size;
}

#define COUNTED(name, sent, parameters, arguments)                                                                                                  \
    int P##name parameters;                                                                                                                         \
    int name parameters                                                                                                                             \
    {                                                                                                                                               \
        const double begin = now();                                                                                                                 \
        const int outer = !depth++;                                                                                                                 \
        const int result = P##name arguments;                                                                                                       \
        --depth;                                                                                                                                    \
        if (outer)                                                                                                                                  \
            bytes += (sent), ++calls, inside += now() - begin;                                                                                      \
        return result;                                                                                                                              \
    }

static double sum(const int *counts, handle comm)
{
    int ranks;
    double total = 0.0;
    PMPI_Comm_size(comm, &ranks);
    for (int i = 0; i < ranks; ++i)
        total += counts[i];
    return total;
}

COUNTED(MPI_Allreduce, n *size_of(t), (const void *s, void *r, int n, handle t, handle op, handle c), (s, r, n, t, op, c))
COUNTED(MPI_Allgather, n *size_of(t), (const void *s, int n, handle t, void *r, int m, handle u, handle c), (s, n, t, r, m, u, c))
COUNTED(MPI_Allgatherv, n *size_of(t), (const void *s, int n, handle t, void *r, const int *m, const int *at, handle u, handle c),
        (s, n, t, r, m, at, u, c))
COUNTED(MPI_Gatherv, n *size_of(t), (const void *s, int n, handle t, void *r, const int *m, const int *at, handle u, int root, handle c),
        (s, n, t, r, m, at, u, root, c))
COUNTED(MPI_Alltoallv, sum(n, c) * size_of(t),
        (const void *s, const int *n, const int *f, handle t, void *r, const int *m, const int *g, handle u, handle c),
        (s, n, f, t, r, m, g, u, c))
COUNTED(MPI_Bcast, n *size_of(t), (void *s, int n, handle t, int root, handle c), (s, n, t, root, c))
COUNTED(MPI_Barrier, 0, (handle c), (c))
COUNTED(MPI_Send, n *size_of(t), (const void *s, int n, handle t, int to, int tag, handle c), (s, n, t, to, tag, c))
COUNTED(MPI_Isend, n *size_of(t), (const void *s, int n, handle t, int to, int tag, handle c, handle *q), (s, n, t, to, tag, c, q))
COUNTED(MPI_Recv, 0, (void *s, int n, handle t, int from, int tag, handle c, handle *q), (s, n, t, from, tag, c, q))
COUNTED(MPI_Wait, 0, (handle * q, handle *s), (q, s))
COUNTED(MPI_Waitall, 0, (int n, handle *q, handle *s), (n, q, s))
COUNTED(MPI_Mprobe, 0, (int from, int tag, handle c, handle *m, handle *s), (from, tag, c, m, s))
COUNTED(MPI_Mrecv, 0, (void *s, int n, handle t, handle *m, handle *q), (s, n, t, m, q))
COUNTED(MPI_Neighbor_alltoallv, 0,
        (const void *s, const int *n, const int *f, handle t, void *r, const int *m, const int *g, handle u, handle c),
        (s, n, f, t, r, m, g, u, c))
