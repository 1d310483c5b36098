"""Lengths and speeds, absolute or relative to the bodies: they mean the same on every level (docs/input.md).

The diagonal is that of the smallest body that moves freely (`pdvol.levels.scene_fields.scene_diagonal`), not that of
all bodies together, which would grow with their distance. It is that of the box around a sphere with the body's radius
of gyration: it does not change where the scene is turned.
"""

from dataclasses import dataclass
from typing import Any

from pdvol.scene.checks import keep_plain, positive


@dataclass(frozen=True)
class Relative:
    """A length (or speed) given as a fraction of the smallest free body's diagonal (per second)."""

    fraction: float

    def __post_init__(self) -> None:
        keep_plain(self, "fraction")
        positive("Relative.fraction", self.fraction)


Length = float | Relative


def metres(length: Length, diagonal: float) -> float:
    """A length in metres (or a speed in m/s), given the diagonal [m] of the smallest free body."""
    return length.fraction * diagonal if isinstance(length, Relative) else float(length)


def length(name: str, value: Any) -> None:
    """A positive length or speed, absolute or `Relative`."""
    if not isinstance(value, Relative):
        positive(name, value)
