"""The compiled linear solver: incomplete factor, coarse correction, conjugate gradients.

Block CSR is `hessian_blocks.BlockCsr`, which says what SPARE is.
"""

from pathlib import Path

from pdvol.compiled import Library, ffi

__all__ = ["ffi", "library"]

library = Library(Path(__file__).parent)
