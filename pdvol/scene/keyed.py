"""Numbers that change with time, by keyframes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pdvol.scene.checks import finite, keep_plain, require, sequence
from pdvol.scene.motions import Vector
from pdvol.scene.representation import one_line


@dataclass(frozen=True)
class Keyed:
    """A number that is `values[i]` at `times[i]` [s], straight and even in between, constant before and after.

    It stands for a Young's modulus that changes, and for any number of a load that may be a function of time.
    """

    times: Vector
    values: Sequence[float] | np.ndarray
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "times", "values")
        for name in ("times", "values"):
            sequence(f"Keyed.{name}", getattr(self, name))
            for number in getattr(self, name):
                finite(f"Keyed.{name}", number)
        require(
            len(self.times) == len(self.values) >= 2,
            f"Keyed has {len(self.times)} times and {len(self.values)} values; give as many, two at least",
        )
        require(
            all(a < b for a, b in zip(self.times, self.times[1:], strict=False)),
            f"Keyed.times = {self.times!r} must ascend",
        )

    def __call__(self, time: float) -> float:
        return float(np.interp(time, self.times, self.values))
