/* The rows of a rank in two parts, and its border: what couples its vertices with those of other ranks. */
#include "linear.h"
#include <math.h>
#include <stdlib.h>
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

int64_t border(const linear_system *s, double strong, int32_t ranks, const int64_t *ends, int32_t *number, int32_t *far_columns, int32_t *rows,
               uint8_t *is_strong, int32_t *counts, int32_t *their_counts)
{
    const int dd = s->d * s->d;
    const int64_t end = s->far_starts[s->count];
    int64_t *last = malloc(2 * ranks * sizeof(int64_t)), *next = last + ranks;
    if (!last)
        return -1;
    for (int64_t k = 0; k < end; ++k)
        number[far_columns[k]] = 0;
    int64_t ghosts = 0, column = 0;
    for (int32_t rank = 0; rank < ranks; ++rank) {
        const int64_t before = ghosts;
        for (; column < ends[rank]; ++column)
            if (number[column] == 0)
                number[column] = ghosts++;
        their_counts[rank] = ghosts - before, counts[rank] = 0, last[rank] = -1;
    }
    for (int pass = 0; pass < 2; ++pass) { /* counts, then lists them */
        for (int64_t i = 0; i < s->count; ++i)
            for (int64_t k = s->far_starts[i], rank = 0; k < s->far_starts[i + 1]; ++k) {
                while (far_columns[k] >= ends[rank])
                    ++rank;
                if (last[rank] != i && pass)
                    rows[next[rank]] = i, is_strong[next[rank]++] = 0;
                counts[rank] += last[rank] != i && !pass;
                last[rank] = i;
                if (pass && squares(dd, s->far_blocks + k * dd) >= strong * strong * squares(dd, s->blocks + (int64_t)s->starts[i] * dd))
                    is_strong[next[rank] - 1] = 1;
            }
        for (int32_t rank = 0; rank < ranks; ++rank)
            last[rank] = -1, next[rank] = rank ? next[rank - 1] + counts[rank - 1] : 0;
    }
    for (int64_t k = 0; k < end; ++k)
        far_columns[k] = number[far_columns[k]];
    memset(number, -1, ends[ranks - 1] * sizeof(int32_t));
    free(last);
    return ghosts;
}

void pack_overlap(const linear_system *s, int32_t ranks, const int32_t *counts, const int32_t *rows, const uint8_t *is_strong, int32_t *number,
                  int32_t *numbers, double *blocks, int32_t *block_counts, int32_t *shared, int32_t *shared_counts, float *weights)
{
    const int dd = s->d * s->d;
    int64_t end = 0;
    for (int64_t i = 0; i < s->count; ++i)
        weights[i] = 1.0f;
    for (int32_t rank = 0; rank < ranks; rows += counts[rank], is_strong += counts[rank], shared += shared_counts[rank], ++rank) {
        int32_t *lengths = numbers;
        const int64_t first = end;
        numbers += counts[rank], shared_counts[rank] = 0;
        for (int64_t i = 0; i < counts[rank]; ++i)
            if (is_strong[i]) {
                number[rows[i]] = shared_counts[rank];
                shared[shared_counts[rank]++] = rows[i];
                weights[rows[i]] += 1.0f;
            }
        for (int64_t i = 0; i < counts[rank]; ++i) {
            const int64_t before = end;
            for (int64_t k = s->starts[rows[i]]; is_strong[i] && k < s->starts[rows[i] + 1]; ++k)
                if (number[s->columns[k]] >= 0) {
                    memcpy(blocks + end++ * dd, s->blocks + k * dd, dd * sizeof(double));
                    *numbers++ = number[s->columns[k]];
                }
            lengths[i] = end - before;
        }
        for (int64_t i = 0; i < shared_counts[rank]; ++i)
            number[shared[i]] = -1;
        block_counts[rank] = end - first;
    }
    for (int64_t i = 0; i < s->count; ++i)
        weights[i] = 1.0f / sqrtf(weights[i]);
}

int unpack_overlap(const linear_system *s, int32_t ranks, const int32_t *counts, const int32_t *block_counts, const int32_t *numbers,
                   const double *blocks, int32_t *shared_counts, int32_t *others_starts, int32_t *others_columns, double *others_blocks)
{
    const int dd = s->d * s->d;
    int64_t ghosts = 0, others = s->count, end = 0;
    for (int32_t rank = 0; rank < ranks; ++rank)
        ghosts += counts[rank];
    int32_t *number = malloc(ghosts * sizeof(int32_t) + 1); /* of a ghost in the factor, or -1 */
    if (!number)
        return 1;
    const int32_t *lengths = numbers;
    ghosts = 0;
    for (int32_t rank = 0; rank < ranks; lengths += counts[rank] + block_counts[rank], ++rank) {
        const int64_t before = others;
        for (int64_t i = 0; i < counts[rank]; ++i)
            number[ghosts++] = lengths[i] ? others++ : -1;
        shared_counts[rank] = others - before;
    }
    for (int64_t i = 0; i < s->count; ++i) {
        others_starts[i] = end;
        for (int64_t k = s->far_starts[i]; k < s->far_starts[i + 1]; ++k)
            if (number[s->far_columns[k]] >= 0) {
                memcpy(others_blocks + end * dd, s->far_blocks + k * dd, dd * sizeof(double));
                others_columns[end++] = number[s->far_columns[k]];
            }
    }
    free(number);
    int64_t row = s->count, first = row;
    for (int32_t rank = 0; rank < ranks; first += shared_counts[rank], ++rank) {
        const int32_t *columns = numbers + counts[rank];
        memcpy(others_blocks + end * dd, blocks, block_counts[rank] * dd * sizeof(double));
        for (int64_t i = 0; i < counts[rank]; ++i)
            if (numbers[i]) {
                others_starts[row++] = end;
                for (int32_t k = 0; k < numbers[i]; ++k)
                    others_columns[end++] = first + *columns++;
            }
        numbers = columns, blocks += block_counts[rank] * dd;
    }
    others_starts[row] = end;
    memset(others_blocks + end * dd, 0, SPARE * sizeof(double));
    return 0;
}
