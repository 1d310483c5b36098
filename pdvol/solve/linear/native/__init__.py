"""The compiled linear solver: incomplete factor, coarse correction, conjugate gradients.

Block CSR is `hessian_blocks.BlockCsr`, which says what SPARE is.
"""

from functools import cache
from pathlib import Path
from typing import Any

from pdvol.compiled import ffi, load

ffi.cdef(
    """
typedef struct {
    int32_t d, count;
    const int32_t *starts, *columns;
    const double *blocks;
    const int32_t *far_starts, *far_columns;
    const double *far_blocks;
    const float *factor;
    int32_t nodes;
    const int32_t *p_starts, *p_columns;
    const double *p_weights;
    const int64_t *begins;
    const double *coarse;
    void (*exchange)(const double *own, double *far);
    void (*sum)(double *numbers, int32_t count);
} linear_system;
int incomplete_cholesky(int d, int64_t n, const int32_t *starts, const int32_t *columns, const double *blocks,
                        float *R);
void coarse_firsts(int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns,
                   const int32_t *p_starts, const int32_t *p_columns, int32_t *firsts);
int coarse_operator(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns,
                    const double *blocks, const int32_t *p_starts, const int32_t *p_columns, const double *p_weights,
                    int64_t nodes, const int64_t *begins, double *out);
int coarse_cholesky(int64_t n, const int64_t *begins, double shift, double *L);
void precondition_locally(const linear_system *system, float *z);
void add_coarse_correction(const linear_system *system, const double *residual, double *x, float *z);
int symmetric_product(const linear_system *system, const double *x, double *far, double *y);
int conjugate_gradients(const linear_system *system, const double *right, double tolerance, int32_t most, double *far,
                        double *solution, int32_t *iterations);
"""
)


@cache
def library() -> Any:
    """The loaded library."""
    return load(Path(__file__).parent)
