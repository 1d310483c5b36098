"""One minimisation of an incremental potential, without its linear algebra: states, energies, and the records of
iterations.

`Newton` passes on what SNES reports: a state, a direction, an accepted step. `Minimisation` decides on the length of
the step, whether the matrix is kept, and whether the solve ends.
"""

from dataclasses import replace
from functools import partial

import numpy as np
from mpi4py import MPI

from pdvol.errors import SimulationError
from pdvol.parallel import reduce
from pdvol.potentials.potential import LastStates, Positions
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.iteration import (
    TOO_STIFF,
    Iteration,
    Projection,
    is_at_rounding,
    is_short,
    keeps_matrix,
    opens,
    promised_decrease,
    share_kept,
    step_factor,
    stops,
)
from pdvol.solve.report import NewtonReport


class Minimisation:
    """The state of one solve from x.

    Parameters
    ----------
    potential : IncrementalPotential
    fixed : (n_owned,) bool
        Vertices that do not move.
    dt : length of the step [s]
    tolerance : [m/s]
    gap_share : share of a gap that a step which contact ends leaves
    relative_tolerance : share of the largest change of velocity at the present state, where that is more than
        `tolerance`

    Attributes
    ----------
    report : NewtonReport
    projection : of the next Hessian
    gradient : (n_owned, d), zero in fixed rows
    """

    def __init__(
        self,
        potential: IncrementalPotential,
        fixed: np.ndarray,
        x: Positions,
        dt: float,
        tolerance: float,
        gap_share: float,
        relative_tolerance: float = 0.0,
    ):
        self.potential, self.comm = potential, potential.space.comm
        self._sum = partial(reduce, self.comm)
        self.report, self.projection, self.gradient = NewtonReport(), Projection(), np.zeros_like(x.owned)
        self._fixed, self._dt, self._gap_share = fixed, dt, gap_share
        self._tolerance, self._strict, self._relative = tolerance, tolerance, relative_tolerance
        self._states = [x]
        self._energies = LastStates()
        self._last: Iteration | None = None
        self._before: Iteration | None = None
        self._matrix_age: int | None = None
        self._trials = 0

    # ---- states

    def positions(self, array: np.ndarray) -> Positions:
        """The configuration of owned rows (n_owned, d); the last two are kept, so that terms share what they derived
        from them. Collective.
        """
        for known in self._states:
            if reduce(self.comm, bool((known.owned == array).all()), MPI.LAND):
                return known
        self._states = [Positions(self.potential.space, array.copy()), *self._states[:1]]
        return self._states[0]

    def energy(self, x: Positions) -> float:
        """The potential at x, evaluated once for each of the last two states."""
        return self._energies.value(x, self.potential.value)

    def objective(self, x: Positions) -> float:
        """The energy that the line search compares; at round-off the model's, which it accepts."""
        last = self._last
        if last is None or x is last.start:
            return self.energy(x)
        self._trials += 1
        return last.energy + 0.5 * last.slope if last.at_rounding else self.energy(x)

    def evaluate_gradient(self, x: Positions) -> np.ndarray:
        """The gradient (n_owned, d) at x, zero in fixed rows."""
        self.gradient = self.potential.gradient(x)
        self.gradient[self._fixed] = 0.0
        return self.gradient

    def gradient_norm(self) -> float:
        """Infinity norm of the last gradient [kg m]. Collective."""
        return reduce(self.comm, float(np.abs(self.gradient).max(initial=0.0)), MPI.MAX)

    # ---- the matrix

    def keeps_matrix(self) -> bool:
        """Whether the next iteration takes the last matrix; a new one is counted."""
        if self._matrix_age is not None and keeps_matrix(self._last, self._before, self._tolerance):
            self._matrix_age += 1
            return True
        self.renew_matrix()
        return False

    def renew_matrix(self) -> None:
        """Counts an assembled matrix."""
        self._matrix_age = 0
        self.report.hessians += 1

    def drop_matrix(self) -> None:
        """The next iteration needs a new matrix."""
        self._matrix_age = None

    # ---- iterations

    def begin_iteration(self, x: Positions, direction: np.ndarray) -> float:
        """Records Newton's direction (n_owned, d) at x; returns the factor of it that the line search begins with.

        Raises SimulationError where the direction is not finite. Collective.
        """
        self.require_finite(direction)
        speed = self._largest_row(direction) / self._dt
        if self._relative > 0.0:
            change = self._largest_row(x.owned - self.potential.x_hat) / self._dt
            self._tolerance = max(self._strict, self._relative * change)
        slope = reduce(self.comm, float(np.vdot(self.gradient, direction)))
        energy = self.energy(x)
        gap = self.potential.min_gap(x) if is_short(speed, self._tolerance) else np.inf
        at_rounding = is_at_rounding(slope, energy, self.potential.scale)
        factor = step_factor(x, direction, speed, at_rounding, self.projection, self._last, self._tolerance, self._sum)
        length = factor * self.potential.max_step(x, factor * direction, gap_share=self._gap_share)
        cap = min(1.0, length)
        self.report.speed, self.report.step_cap = speed, min(self.report.step_cap, cap)
        self._before, self._trials = self._last, 0
        self._last = Iteration(
            x,
            energy,
            direction,
            slope,
            speed,
            self.projection,
            self._matrix_age or 0,
            at_rounding,
            factor,
            cap,
            gap,
        )
        return length

    def end_iteration(self, x: Positions, detects_indefinite: bool) -> str:
        """Records the accepted state x, and chooses the next projection; returns why the solve ends (`stops`), or an
        empty text. Collective.
        """
        last = self._last
        if last is None:
            return ""
        if self._trials > 1:
            last = replace(last, backtracks=self._trials - 1)
            self.report.backtracks += last.backtracks
        if last.at_rounding:
            self.projection = self.projection.after_rounding()
        elif last.lengthening == 1.0:  # the quadratic model does not hold for lengthened steps
            moved, decrease = x.owned - last.start.owned, self.energy(x) - last.energy
            promised = promised_decrease(last.slope, moved, last.direction, self._sum)
            self.projection = self.projection.after(promised, decrease, last.full, detects_indefinite)
            if last.matrix_age == 0 and share_kept(promised, decrease) > TOO_STIFF:
                last = replace(last, softer=True)
        if last.full and is_short(last.speed, self._tolerance):
            last = replace(last, opened=opens(last.gap, self.potential.min_gap(x)))
        self._last = last
        return stops(last, self._before, self._tolerance)

    def descends(self, direction: np.ndarray) -> bool:
        """Whether the potential falls along a direction (n_owned d,) at first. Collective."""
        return reduce(self.comm, float(np.vdot(self.gradient, direction))) < 0.0

    def require_finite(self, direction: np.ndarray) -> None:
        """Raises SimulationError on all ranks unless a direction is finite on all of them. Collective."""
        if not reduce(self.comm, bool(np.isfinite(direction).all()), MPI.LAND):
            raise SimulationError("the linear solve gave NaN or infinity")

    def _largest_row(self, rows: np.ndarray) -> float:
        """Largest row length over all ranks."""
        mine = np.sqrt(np.max(np.sum(rows**2, axis=1), initial=0.0))
        return reduce(self.comm, float(mine), MPI.MAX)
