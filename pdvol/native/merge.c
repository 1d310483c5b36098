/* Rows of a matrix in d x d blocks from those that cells couple and those of pairs, summed by place. */
#include "common.h"

/* Rows of the sum, block CSR with ascending columns: starts (rows + 1), columns and blocks as many as cells and pairs have together at most.
 *
 * cells: block CSR with ascending columns. pairs: local rows, global columns, in any order. first: global
 * number of the first row; n: number of columns. fixed (n), or NULL: vertices whose rows and columns become the identity's. Returns the number of
 * blocks, or -1 if memory ran out. */
int64_t merge_pairs(int64_t rows, int64_t first, int64_t n, const rows_t *cells, int64_t pairs, const int64_t *pair_rows, const int64_t *pair_columns,
                    const double *pair_blocks, const uint8_t *fixed, const rows_t *to)
{
    const int32_t *cell_starts = cells->starts, *cell_columns = cells->columns;
    int32_t *starts = to->starts, *columns = to->columns;
    double *blocks = to->blocks;
    int64_t *buckets = calloc(rows + 2, sizeof(int64_t)), *order = malloc(pairs * sizeof(int64_t) + 1);
    int32_t *place = malloc(n * sizeof(int32_t) + 1);
    if (!buckets || !order || !place) {
        free(buckets), free(order), free(place);
        return -1;
    }
    memset(place, -1, n * sizeof(int32_t));
    for (int64_t p = 0; p < pairs; ++p)
        ++buckets[pair_rows[p] + 2];
    for (int64_t i = 0; i < rows; ++i)
        buckets[i + 2] += buckets[i + 1];
    for (int64_t p = 0; p < pairs; ++p)
        order[buckets[pair_rows[p] + 1]++] = p;
    int64_t count = 0;
    for (int64_t i = 0; i < rows; ++i) {
        const int64_t begin = count;
        const int held = fixed && fixed[first + i];
        starts[i] = begin;
        for (int64_t k = cell_starts[i]; k < cell_starts[i + 1]; ++k)
            if (cell_columns[k] == first + i || !(held || (fixed && fixed[cell_columns[k]])))
                place[cell_columns[k]] = count, columns[count++] = cell_columns[k];
        const int64_t of_cells = count;
        for (int64_t q = buckets[i]; q < buckets[i + 1]; ++q) {
            const int32_t j = pair_columns[order[q]];
            if (place[j] < begin && !(held || (fixed && fixed[j])))
                place[j] = count, columns[count++] = j;
        }
        for (int64_t k = of_cells; k < count; ++k) {
            const int32_t j = columns[k];
            int64_t to = k;
            for (; to > begin && columns[to - 1] > j; --to)
                columns[to] = columns[to - 1];
            columns[to] = j;
        }
        for (int64_t k = begin; of_cells < count && k < count; ++k)
            place[columns[k]] = k;
        if (held || count > of_cells)
            memset(blocks + begin * dd, 0, (count - begin) * dd * sizeof(double));
        for (int a = 0; held && a < d; ++a)
            blocks[begin * dd + a * (d + 1)] = 1.0;
        if (held)
            continue;
        for (int64_t k = cell_starts[i]; k < cell_starts[i + 1]; ++k)
            if (place[cell_columns[k]] >= begin)
                memcpy(blocks + (int64_t)place[cell_columns[k]] * dd, cells->blocks + k * dd, dd * sizeof(double));
        for (int64_t q = buckets[i]; q < buckets[i + 1]; ++q)
            if (place[pair_columns[order[q]]] >= begin) {
                double *block = blocks + (int64_t)place[pair_columns[order[q]]] * dd;
                const double *from = pair_blocks + order[q] * dd;
                for (int e = 0; e < dd; ++e)
                    block[e] += from[e];
            }
    }
    starts[rows] = count;
    free(buckets), free(order), free(place);
    return count;
}
