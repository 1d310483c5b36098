"""The compiled cell loops."""

from pathlib import Path

from pdvol import compat
from pdvol.compiled import FLAGS, Library, cache_folder, ffi, pointer

__all__ = ["FLAGS", "cache_folder", "ffi", "library", "pointer"]

# parameters of an energy density: the C code keeps those of one cell on the stack
MAX_PARAMETERS = 64
# the same for isotropic densities, whose kernels run for eight cells at a time; those with more take the general path
MAX_ISOTROPIC_PARAMETERS = 16
# slots by which blocks are fetched into the cache before they are added to, and spare ones behind the last: with none a
# Hessian of smoothed elements takes 1.4 times as long, with 64 to 200 the same
AHEAD = 96

library = Library(
    Path(__file__).parent,
    {
        "KERNEL_ARGUMENTS": compat.KERNEL_ARGUMENTS,
        "AHEAD": AHEAD,
        "MAX_PARAMETERS": MAX_PARAMETERS,
        "MAX_ISOTROPIC_PARAMETERS": MAX_ISOTROPIC_PARAMETERS,
    },
)
