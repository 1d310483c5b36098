"""The compiled loops of contact: broad phase, collision detection, active pairs, sums over them, and friction."""

from pathlib import Path

from pdvol.compiled import Library, ffi

__all__ = ["ffi", "library"]

library = Library(Path(__file__).parent)
