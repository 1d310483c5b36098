"""Values of fields: lengths relative to the bodies, which mean the same on every level (docs/input.md), and values that
change with time by keyframes.

The diagonal is that of the smallest body that moves freely (`pdvol.levels.scene_fields.scene_diagonal`), not that of
all bodies together, which would grow with their distance. It is that of the box around a sphere with the body's radius
of gyration: it does not change where the scene is turned.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.scene.checks import Check, ascending, finite, positive, require, sequence, takes, vector
from pdvol.scene.element import Element

Vector = Sequence[float] | np.ndarray
"""Components: a tuple, a list or an array. The dataclasses keep a tuple."""


@dataclass(frozen=True, repr=False)
class Relative(Element):
    """A length (or speed) given as a fraction of the smallest free body's diagonal (per second)."""

    fraction: float
    checks = {"fraction": positive}


Length = float | Relative


def metres(length: Length, diagonal: float) -> float:
    """A length in metres (or a speed in m/s), given the diagonal [m] of the smallest free body."""
    return length.fraction * diagonal if isinstance(length, Relative) else float(length)


def length(name: str, value: Any) -> None:
    """A positive length or speed, absolute or `Relative`."""
    if not isinstance(value, Relative):
        positive(name, value)


@dataclass(frozen=True, repr=False)
class Keyed(Element):
    """A number or a vector that is `values[i]` at `times[i]` [s], straight and even in between, constant before and
    after.

    Numbers stand for a Young's modulus that changes, a muscle's activation, and any number of a load that may be a
    function of time. Vectors stand for a load's vector, as that of gravity or of a wind.
    """

    times: Vector
    values: Sequence[float] | Sequence[Vector] | np.ndarray
    checks = {"times": ascending, "values": sequence}

    def __post_init__(self) -> None:
        super().__post_init__()
        for value in self.values:
            (vector if self.is_vector else finite)("Keyed.values", value)
        as_many(self, "times", "values")
        require(
            not self.is_vector or len({len(value) for value in self.values}) == 1,  # type: ignore[arg-type]
            f"Keyed.values = {self.values!r} must have as many components each",
        )

    @property
    def is_vector(self) -> bool:
        """Whether its values are vectors."""
        return len(self.values) > 0 and isinstance(self.values[0], tuple)

    def __call__(self, time: float) -> float | np.ndarray:
        values = np.asarray(self.values, dtype=float)
        return interpolated(time, self.times, values) if self.is_vector else float(np.interp(time, self.times, values))


def interpolated(time: float, times: Vector, values: Sequence[Vector] | np.ndarray) -> np.ndarray:
    """(d,) vectors (k, d) at ascending times (k,), straight and even in between: at each of these to the last bit."""
    return np.array([np.interp(time, times, component) for component in np.asarray(values, dtype=float).T])


def as_many(keys: Element, *names: str) -> None:
    """Two sequences of the same length, two at least."""
    one, other = (len(getattr(keys, name)) for name in names)
    kind = type(keys).__name__
    require(one == other >= 2, f"{kind} has {one} {names[0]} and {other} {names[1]}; give as many, two at least")


def timed(check: Check, *arguments: str) -> Check:
    """A value that may change with time: one that fits, `Keyed` ones, or a function of these arguments, t if none."""

    def changing(name: str, value: Any) -> None:
        if isinstance(value, Keyed):
            kind, other = ("vector", "number") if check is vector else ("number", "vector")
            require(value.is_vector == (check is vector), f"{name} is a {kind}: give Keyed {kind}s, not {other}s")
        elif callable(value):
            takes(name, value, *(arguments or ("t",)))
        else:
            check(name, value)

    return changing
