/* Vectors inside the loop have four numbers a vertex, of which those behind the d-th are zero: rows of d x d blocks are then read as four
 * numbers, too, and what follows a row is multiplied by zero or never read. Arrays of blocks therefore have SPARE finite numbers at their end. */
#pragma once
#include "common.h"

#define SPARE 4
typedef double wide __attribute__((vector_size(32), aligned(8), may_alias));
typedef float narrow __attribute__((vector_size(16), aligned(4), may_alias));

/* The sum of the squares of n numbers: for a block, of its Frobenius norm. */
INLINE double squares(int64_t n, const double *numbers)
{
    double sum = 0.0;
    for (int64_t e = 0; e < n; ++e)
        sum += numbers[e] * numbers[e];
    return sum;
}

/* Sums numbers over all ranks, in place. */
void sum_over_ranks(const linear_system *s, double *numbers, int32_t count);
