"""The compiled cell loops."""

from pathlib import Path

from pdvol.compiled import FLAGS, Library, cache_folder, ffi, pointer, processor_features

__all__ = ["FLAGS", "cache_folder", "ffi", "library", "pointer"]

# domains for which a kernel is evaluated at once: as many as the widest vector registers hold numbers, since GCC takes
# memory for wider vectors, with which a Hessian takes 4 to 8 times as long
LANES = 8 if "avx512f" in processor_features() else 4
# parameters of an energy density: the C code keeps those of LANES domains on the stack
MAX_PARAMETERS = 64
# slots by which blocks are fetched into the cache before they are added to, and spare ones behind the last: with none a
# Hessian of smoothed elements takes 1.4 times as long, with 64 to 200 the same
AHEAD = 96

library = Library(
    Path(__file__).parent,
    {"LANES": LANES, "AHEAD": AHEAD, "MAX_PARAMETERS": MAX_PARAMETERS},
)
