"""Numbers and vectors that change with time, by keyframes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.scene.checks import finite, keep_plain, require, sequence, vector
from pdvol.scene.motions import Vector
from pdvol.scene.representation import one_line


@dataclass(frozen=True)
class Keyed:
    """A number or a vector that is `values[i]` at `times[i]` [s], straight and even in between, constant before and
    after.

    Numbers stand for a Young's modulus that changes, a muscle's activation, and any number of a load that may be a
    function of time. Vectors stand for a load's vector, as that of gravity or of a wind.
    """

    times: Vector
    values: Sequence[float] | Sequence[Vector] | np.ndarray
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "times", "values")
        sequence("Keyed.times", self.times)
        sequence("Keyed.values", self.values)
        for time in self.times:
            finite("Keyed.times", time)
        for value in self.values:
            (vector if self.is_vector else finite)("Keyed.values", value)
        require(
            len(self.times) == len(self.values) >= 2,
            f"Keyed has {len(self.times)} times and {len(self.values)} values; give as many, two at least",
        )
        require(
            all(a < b for a, b in zip(self.times, self.times[1:], strict=False)),
            f"Keyed.times = {self.times!r} must ascend",
        )
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
        if not self.is_vector:
            return float(np.interp(time, self.times, values))
        return np.array([np.interp(time, self.times, component) for component in values.T])


def keyed_numbers(name: str, value: Keyed) -> None:
    """Keys that are numbers."""
    require(not value.is_vector, f"{name} is a number: give Keyed numbers, not vectors")


def keyed_vectors(name: str, value: Keyed) -> None:
    """Keys that are vectors."""
    require(value.is_vector, f"{name} is a vector: give Keyed vectors, not numbers")
