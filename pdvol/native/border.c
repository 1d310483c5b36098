/* The rows of a rank in two parts, and its border: what couples its vertices with those of other ranks. */
#include "linear.h"

/* Columns of `far` are global. */
void split_rows(int64_t rows, int64_t first, const rows_t *all, const rows_t *own, const rows_t *far)
{
    int64_t inner = 0, outer = 0;
    for (int64_t i = 0; i < rows; ++i) {
        own->starts[i] = inner, far->starts[i] = outer;
        for (int64_t k = all->starts[i]; k < all->starts[i + 1]; ++k) {
            const int64_t column = all->columns[k] - first;
            const int inside = column >= 0 && column < rows;
            memcpy(inside ? own->blocks + inner * dd : far->blocks + outer * dd, all->blocks + k * dd, dd * sizeof(double));
            if (inside)
                own->columns[inner++] = column;
            else
                far->columns[outer++] = all->columns[k];
        }
    }
    own->starts[rows] = inner, far->starts[rows] = outer;
}

int64_t border(const linear_system *s, double strong, int32_t ranks, const int64_t *ends, int32_t *number, int32_t *rows, uint8_t *is_strong,
               int32_t *counts, int32_t *their_counts)
{
    int32_t *far_columns = s->far.columns;
    const int64_t end = s->far.starts[s->count];
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
            for (int64_t k = s->far.starts[i], rank = 0; k < s->far.starts[i + 1]; ++k) {
                while (far_columns[k] >= ends[rank])
                    ++rank;
                if (last[rank] != i && pass)
                    rows[next[rank]] = i, is_strong[next[rank]++] = 0;
                counts[rank] += last[rank] != i && !pass;
                last[rank] = i;
                if (pass && squares(dd, s->far.blocks + k * dd) >= strong * strong * squares(dd, s->own.blocks + (int64_t)s->own.starts[i] * dd))
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
            for (int64_t k = s->own.starts[rows[i]]; is_strong[i] && k < s->own.starts[rows[i] + 1]; ++k)
                if (number[s->own.columns[k]] >= 0) {
                    memcpy(blocks + end++ * dd, s->own.blocks + k * dd, dd * sizeof(double));
                    *numbers++ = number[s->own.columns[k]];
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
                   const double *blocks, int32_t *shared_counts, const rows_t *between)
{
    int32_t *others_starts = between->starts, *others_columns = between->columns;
    double *others_blocks = between->blocks;
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
        for (int64_t k = s->far.starts[i]; k < s->far.starts[i + 1]; ++k)
            if (number[s->far.columns[k]] >= 0) {
                memcpy(others_blocks + end * dd, s->far.blocks + k * dd, dd * sizeof(double));
                others_columns[end++] = number[s->far.columns[k]];
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
