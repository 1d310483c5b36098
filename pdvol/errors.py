"""Errors that carry their data. `InputError` is a user's mistake (exit code 2), `SimulationError` the end of a run
(exit code 1).
"""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np


class PdvolError(Exception):
    """Any error pdvol raises on purpose."""


class InputError(PdvolError, ValueError):
    """A user's mistake. The message says in one line what is wrong, where, and how to mend it."""


class SeveralErrors(InputError):
    """Several mistakes at once; `lines` has a message for each."""

    def __init__(self, lines: Iterable[str]):
        self.lines = tuple(lines)
        super().__init__("\n".join(self.lines))


class MeshError(InputError):
    """A mesh that cannot be simulated or read."""


class LevelError(MeshError):
    """A shape of which no mesh came out for the `level`."""

    def __init__(self, message: str, level: int = 0):
        super().__init__(message)
        self.level = level


class InvertedCellError(MeshError):
    """Cells of non-positive volume at rest. `cells` are their indices in the input."""

    def __init__(self, message: str, cells: Iterable[int] = ()):
        super().__init__(message)
        self.cells = tuple(int(c) for c in cells)


class IntersectionError(InputError):
    """Primitives that cross at t = 0.

    Attributes
    ----------
    pairs : the primitives
    corners : the places of their corners, an array (k, d) [m] each, of a shape that crosses itself before it is in a
        scene; none otherwise
    level, bodies : where, and the indices of the bodies that meet; none in a shape that crosses itself before it is in
        a scene
    push : (d,) unit vector along which the first body leaves the other body or obstacle, None for a body that meets
        itself
    """

    def __init__(
        self,
        message: str,
        pairs: Iterable = (),
        level: int = 0,
        bodies: Iterable[int] = (),
        push: "Sequence[float] | np.ndarray | None" = None,
        corners: "Sequence[np.ndarray]" = (),
    ):
        super().__init__(message)
        self.pairs, self.level, self.bodies, self.push = tuple(pairs), level, tuple(int(b) for b in bodies), push
        self.corners = corners


class SimulationError(PdvolError):
    """A simulation that cannot go on."""


class ConvergenceError(SimulationError):
    """No converged state was found for one step.

    Attributes
    ----------
    level, step : int
    reason : str
    """

    def __init__(self, level: int, step: int, reason: str):
        super().__init__(f"level {level}, step {step}: {reason}")
        self.level, self.step, self.reason = level, step, reason

    def __reduce__(self) -> tuple:  # errors travel between processes
        return type(self), (self.level, self.step, self.reason)
