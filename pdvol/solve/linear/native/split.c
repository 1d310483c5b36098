/* The rows of a rank in two parts: what couples its own vertices, and what couples them with those of others. */
#include "linear.h"
#include <string.h>

/* Block CSR with ascending columns each; columns of the second part are global. */
void split_rows(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks, int32_t *own_starts,
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
}
