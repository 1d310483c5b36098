"""The compiled linear solver: incomplete factor, coarse correction, conjugate gradients.

Block CSR is `hessian_blocks.BlockCsr`, which says what SPARE is.
"""

from functools import cache
from pathlib import Path
from typing import Any

from pdvol.compiled import declare, ffi, load

declare(Path(__file__).parent)


@cache
def library() -> Any:
    """The loaded library."""
    return load(Path(__file__).parent)
