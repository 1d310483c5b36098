"""The compiled cell loops and products with prolongations."""

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
int galerkin(int d, int64_t rows, int64_t first, const int32_t *starts, const int32_t *columns, const double *blocks,
             const int32_t *p_starts, const int32_t *p_columns, const double *p_weights, int64_t coarse,
             const int32_t *table, double *out);
void restriction(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights,
                 const double *fine, double *coarse);
void prolongation(int d, int64_t rows, const int32_t *starts, const int32_t *columns, const double *weights,
                  const double *coarse, double *fine);
int64_t inverted_cells(int d, int64_t count, const int32_t *dofs, const double *x);
double volume_step(int d, int64_t count, const int32_t *dofs, const double *x, const double *p, double keep);
"""
)


@cache
def library() -> Any:
    """The loaded library."""
    return load(
        Path(__file__).parent,
        ("elements.c", "isotropic.c", "prolongations.c"),
        ("kernel.h",),
        (
            f"KERNEL_ARGUMENTS={compat.KERNEL_ARGUMENTS}",
            f"MAX_PARAMETERS={MAX_PARAMETERS}",
            f"MAX_ISOTROPIC_PARAMETERS={MAX_ISOTROPIC_PARAMETERS}",
        ),
    )
