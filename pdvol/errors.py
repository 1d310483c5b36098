"""Errors that carry their data. `InputError` is a user's mistake (exit code 2), `SimulationError` the end of a run (exit code 1)."""


class PdvolError(Exception):
    """Any error pdvol raises on purpose."""


class InputError(PdvolError, ValueError):
    """A user's mistake, told in one line: what, where, and the mend."""


class MeshError(InputError):
    """A mesh that cannot be simulated or read."""


class InvertedCellError(MeshError):
    """Cells of non-positive volume at rest. `cells` are their indices in the input."""

    def __init__(self, message: str, cells=()):
        super().__init__(message)
        self.cells = tuple(int(c) for c in cells)


class IntersectionError(InputError):
    """Primitives that cross at t = 0. `pairs` names them."""

    def __init__(self, message: str, pairs=()):
        super().__init__(message)
        self.pairs = tuple(pairs)


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

    def __reduce__(self):  # errors travel between processes
        return type(self), (self.level, self.step, self.reason)
