"""The compiled cell loops."""

from functools import cache
from pathlib import Path
from typing import Any

from pdvol import compat
from pdvol.compiled import FLAGS, cache_folder, ffi, load, pointer

__all__ = ["FLAGS", "cache_folder", "ffi", "library", "pointer"]

# parameters of an energy density: the C code keeps those of one cell on the stack
MAX_PARAMETERS = 64
# the same for isotropic densities, whose kernels run for eight cells at a time; those with more take the general path
MAX_ISOTROPIC_PARAMETERS = 16

ffi.cdef(
    """
double cell_values(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                   const double *volumes, const double *parameters, int np, int at);
void cell_gradients(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                    const double *volumes, const double *parameters, int np, int at, double *out);
int64_t cell_hessians(void *kernel, int d, int64_t count, const int32_t *dofs, const double *x, const double *inverse,
                      const double *volumes, const double *parameters, int np, int at, const int32_t *slots, int mode,
                      double weight, double *out);
int64_t isotropic_hessians(void *gradient, void *hessian, const int32_t *arguments, int ng, int nh, int64_t count,
                           const int32_t *dofs, const double *x, const double *inverse, const double *volumes,
                           const double *parameters, int np, const int32_t *slots, int mode, double weight,
                           double *out);
int64_t merge_pairs(int d, int64_t rows, int64_t first, int64_t n, const int32_t *cell_starts,
                    const int32_t *cell_columns, const double *cells, int64_t pairs, const int64_t *pair_rows,
                    const int64_t *pair_columns, const double *pair_blocks, const uint8_t *fixed, int32_t *starts,
                    int32_t *columns, double *blocks);
int64_t inverted_cells(int d, int64_t count, const int32_t *dofs, const double *x);
double volume_step(int d, int64_t count, const int32_t *dofs, const double *x, const double *p, double keep);
"""
)


@cache
def library() -> Any:
    """The loaded library."""
    definitions = {
        "KERNEL_ARGUMENTS": compat.KERNEL_ARGUMENTS,
        "MAX_PARAMETERS": MAX_PARAMETERS,
        "MAX_ISOTROPIC_PARAMETERS": MAX_ISOTROPIC_PARAMETERS,
    }
    return load(Path(__file__).parent, definitions)
