"""The compiled loops of contact: broad phase, collision detection, active pairs, sums over them, and friction."""

from functools import cache
from pathlib import Path
from typing import Any

from pdvol.compiled import declare, ffi, load

__all__ = ["ffi", "library"]

declare(Path(__file__).parent)


@cache
def library() -> Any:
    """The loaded library."""
    return load(Path(__file__).parent)
