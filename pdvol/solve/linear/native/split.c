/* The rows of a rank in two parts: what couples its own vertices, and what couples them with those of others. */
#include "linear.h"
#include <string.h>

INLINE int64_t split(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks, int32_t *own_starts,
                     int32_t *own_columns, double *own_blocks, int32_t *far_starts, int32_t *far_columns, double *far_blocks)
{
    const int dd = d * d;
    int64_t own = 0, far = 0;
    for (int64_t i = 0; i < rows; ++i) {
        own_starts[i] = own, far_starts[i] = far;
        for (int64_t k = starts[i]; k < starts[i + 1]; ++k) {
            const int64_t column = columns[k] - first;
            const int inside = column >= 0 && column < rows;
            memcpy(inside ? own_blocks + own * dd : far_blocks + far * dd, blocks + k * dd, dd * sizeof(double));
            if (inside)
                own_columns[own++] = column;
            else
                far_columns[far++] = columns[k];
        }
    }
    own_starts[rows] = own, far_starts[rows] = far;
    return far;
}

/* Block CSR with ascending columns each; columns of the second part are global. Returns how many blocks the second part has. */
int64_t split_rows(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks, int32_t *own_starts,
                   int32_t *own_columns, double *own_blocks, int32_t *far_starts, int32_t *far_columns, double *far_blocks)
{
    return d == 3 ? split(3, rows, first, starts, columns, blocks, own_starts, own_columns, own_blocks, far_starts, far_columns, far_blocks)
                  : split(2, rows, first, starts, columns, blocks, own_starts, own_columns, own_blocks, far_starts, far_columns, far_blocks);
}
