"""The compiled loops over domains, contacts and rows of matrices.

Block CSR is `hessian_blocks.BlockCsr`, which says what SPARE is.
"""

from pathlib import Path

from pdvol.compiled import Library

__all__ = ["library"]

# domains for which a kernel is evaluated at once: as many as AVX2's registers hold numbers. Where registers are smaller
# than these vectors, GCC takes memory for them, and a Hessian takes 4 times as long. With eight, which AVX-512 holds, a
# step is up to a twentieth faster where bodies fly, and slower where contact lasts
LANES = 4
# parameters of an energy density: the C code keeps those of LANES domains on the stack
MAX_PARAMETERS = 64
# slots by which blocks are fetched into the cache before they are added to, and spare ones behind the last: with none a
# Hessian of smoothed elements takes 1.4 times as long, with 64 to 200 the same
AHEAD = 96

library = Library(Path(__file__).parent, {"LANES": LANES, "AHEAD": AHEAD, "MAX_PARAMETERS": MAX_PARAMETERS})
