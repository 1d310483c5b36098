"""Projected Newton on an incremental potential by PETSc's SNES, which no other file uses.

The potential is SNES's objective, the gradient its function, the projected Hessian its Jacobian. The pre-check shortens
each step such that nothing crosses or inverts, and the potential falls on all of it; SNES's line search goes on there.
`iteration.py` has the rules of the callbacks: when a solve ends, when a matrix is kept, which Hessian is next.
"""

from collections.abc import Callable, Iterable

import numpy as np
from mpi4py import MPI

from pdvol.compat import PETSc
from pdvol.errors import SimulationError
from pdvol.potentials.potential import Positions, same
from pdvol.scene import Relative
from pdvol.solve.callbacks import own_errors, weakly
from pdvol.solve.incremental_potential import is_finite
from pdvol.solve.iteration import (
    BALANCED,
    LEAST_DECREASE,
    STALL,
    TOO_STIFF,
    TRUSTED,
    Iteration,
    Solve,
    falling_share,
    fraction_kept,
    gains_nothing,
    is_at_rounding,
    keeps_matrix,
    next_projection,
    speed_of,
    step_factor,
    stops,
)
from pdvol.solve.linear.solver import LinearSolver
from pdvol.solve.newton_system import NewtonSystem
from pdvol.solve.report import NewtonReport

# predictions of contact and friction at most, for one direction: two serve most, each is a linear solve, and where many
# bodies meet, six gain nothing over four
PREDICTIONS = 4
LONGEST_DIRECTION = 1e4  # sizes of all bodies together: what is longer, as of a law without a minimum, predicts nothing

_REASONS = {value: name for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}
_NAN = next(value for value, name in _REASONS.items() if "NAN" in name)  # PETSc 3.25 has it by another name


class Newton:
    """Minimises an `IncrementalPotential` over the vertices that are not held.

    Parameters
    ----------
    system : its settings' tolerance is in m/s
    iterated : called with the state after each iteration of a solve, or before a direction, and how many there were

    Attributes
    ----------
    snes : PETSc.SNES
    tolerance : [m/s]
    """

    def __init__(self, system: NewtonSystem, iterated: Callable[[Positions, int], None] = lambda x, iterations: None):
        if isinstance(system.settings.tolerance, Relative):
            raise ValueError("Newton's tolerance must be a speed in m/s, not a Relative one")
        self.system, self.space, self.potential = system, system.space, system.potential
        self.supported, self.settings = system.supported, system.settings
        self.tolerance, self._dt = system.settings.tolerance, np.inf
        self._far = LONGEST_DIRECTION * np.linalg.norm(np.ptp(self.space.mesh.points, axis=0))  # [m]
        self.iterated, self._sum = iterated, self.space.reduce
        self._free = self.potential.rows_of_bodies(~self.supported)
        self._vector, self._residual = self.space.create_vector(), self.space.create_vector()
        self.snes = self._create_snes()
        self.system.use(self.snes.ksp)
        self._solve: Solve

    def _create_snes(self) -> PETSc.SNES:
        snes = PETSc.SNES().create(comm=self.space.comm)
        snes.setType(PETSc.SNES.Type.NEWTONLS)
        snes.setObjective(weakly(self._objective))
        snes.setFunction(weakly(self._function), self._residual)
        snes.setJacobian(weakly(self._jacobian), self.system.matrix.shell)
        snes.setLineSearchPreCheck(weakly(self._precheck))
        snes.setConvergenceTest(weakly(self._test))
        snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=self.settings.max_iterations)
        return snes

    # ---- callbacks

    def _positions(self, vector: PETSc.Vec) -> Positions:
        """The configuration of a vector, found once for each of its states. Collective."""
        known, state = self._solve.vectors.get(vector.handle), vector.stateGet()
        if known is None or known[0] != state:
            known = self._solve.vectors[vector.handle] = state, self._configuration(vector)
        return known[1]

    def _configuration(self, vector: PETSc.Vec) -> Positions:
        """Of the last two configurations that of a vector, or a new one, which then is the last. Collective."""
        solve, array = self._solve, vector.getArray(readonly=True).reshape(-1, self.space.dim)
        alike: Iterable[bool] = (same(known.owned, array) for known in solve.states)
        if self.space.comm.size > 1:
            alike = self.space.reduce(np.array(list(alike)), MPI.LAND)
        for known, is_it in zip(solve.states, alike, strict=True):
            if is_it:
                return known
        solve.states = [Positions(self.space, array.copy()), *solve.states[:1]]
        return solve.states[0]

    def _energy(self, x: Positions) -> float:
        """The potential at x, evaluated once in a solve."""
        # by the solve's number: a state that named its solve would keep itself alive
        return x.get("energy of a solve", lambda: self.potential.value(x), self._solve.serial)

    def _objective(self, snes: PETSc.SNES, vector: PETSc.Vec) -> float:
        """The energy that the line search compares; at round-off the model's, which it accepts."""
        solve, x = self._solve, self._positions(vector)
        last = solve.last
        if last is None or x is last.start:
            return self._energy(x)
        solve.trials += 1
        return last.energy + 0.5 * last.slope if last.by_model else self._energy(x)

    def _function(self, snes: PETSc.SNES, vector: PETSc.Vec, residual: PETSc.Vec) -> None:
        gradient = self.potential.gradient(self._positions(vector))
        gradient[self.supported] = 0.0
        self._solve.gradient = gradient
        residual.setArray(gradient.ravel())

    def _jacobian(self, snes: PETSc.SNES, vector: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        solve = self._solve
        if solve.matrix_age is not None and keeps_matrix(solve.last, solve.before, solve.tolerance):
            solve.matrix_age += 1
        else:
            self._renew_matrix(self._positions(vector))

    def _precheck(self, vector: PETSc.Vec, step: PETSc.Vec) -> None:
        """Scales the step so that nothing crosses or inverts; SNES moves by its negative."""
        x = self._positions(vector)
        self._solve.meets = False
        self.linear.note_iterations(self.snes.ksp.getIterationNumber())
        if self.linear.found_indefinite and self._leave_unprojected():
            self._renew_matrix(x)
            self._solve.report.linear_iterations += self.system.solve(self._residual, step)
        length = self._begin_iteration(x, *self._predict(x, step))
        if length != 1.0:
            step.scale(length)

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int | None:
        reasons, gradient_norm, report = PETSc.SNES.ConvergedReason, norms[2], self._solve.report
        if np.isnan(gradient_norm):
            return _NAN
        if gradient_norm == 0.0:
            report.speed = 0.0
            return reasons.CONVERGED_FNORM_ABS
        if iteration > 0:
            x = self._positions(snes.getSolution())
            self.iterated(x, report.iterations + iteration)
            why = self._end_iteration(x)
            report.reason = "ROUNDING" if why == "ROUNDING" else report.reason
            if why:
                return reasons.CONVERGED_SNORM_RELATIVE
            if self._solve.stalled >= STALL:  # the next remedy
                self._solve.stalled, self._solve.stalls = 0, self._solve.stalls + 1
                return reasons.DIVERGED_LINE_SEARCH
        return reasons.ITERATING

    # ---- iterations

    def _direction(self, step: PETSc.Vec) -> np.ndarray:
        """Newton's direction (n_owned, d), read-only: SNES moves by the negative of its step. Raises SimulationError on
        all ranks unless it is finite on all of them. Collective.
        """
        direction = -step.getArray(readonly=True).reshape(-1, self.space.dim)
        direction.flags.writeable = False
        self.require_finite(direction)
        return direction

    def require_finite(self, direction: np.ndarray) -> None:
        """Raises SimulationError on all ranks unless a direction is finite on all of them. Collective."""
        if not self.space.reduce(is_finite(direction), MPI.LAND):
            raise SimulationError("the linear solve gave NaN or infinity")

    def _slope(self, direction: np.ndarray, at: Positions | None = None) -> float:
        """Derivative of the potential along a direction (n_owned, d), at the present state or another. Collective."""
        gradient = self._solve.gradient if at is None else self.potential.gradient(at)
        return self.space.reduce(float(np.vdot(gradient, direction)))

    def _speed(self, path: np.ndarray) -> float:
        """The largest row of a path (n_owned, d) over the step's length in time [m/s]. Collective."""
        mine = np.sqrt(np.max(np.einsum("nd,nd->n", path, path), initial=0.0))
        return self.space.reduce(float(mine), MPI.MAX) / self._dt

    def _begin_iteration(self, x: Positions, direction: np.ndarray, free: float | None) -> float:
        """Records Newton's direction (n_owned, d) at x, of which the part `free` is admissible (None: to be found);
        returns the factor of it that the line search begins with. Collective.
        """
        solve, relative = self._solve, self.settings.relative_tolerance
        speed = self._speed(direction)
        if relative > 0.0:
            solve.tolerance = max(self.tolerance, relative * self._speed(x.owned - self.potential.x_hat))
        slope, energy = self._slope(direction), self._energy(x)
        at_rounding = is_at_rounding(slope, self.potential.scale)
        plain = at_rounding or solve.meets
        factor = 1.0 if plain else step_factor(x, direction, solve.projection, solve.last, self._sum)
        if factor != 1.0 or free is None:
            free = self.potential.max_step(x, direction if factor == 1.0 else factor * direction)
        length = factor * free
        solve.report.speed, solve.report.step_cap = speed, min(solve.report.step_cap, length)
        solve.states = [x.moved(length, direction), x]
        least = energy + LEAST_DECREASE * length * slope
        if factor == 1.0 and not at_rounding and least < self._energy(solve.states[0]) < np.inf:
            length *= falling_share(lambda share: self._slope(direction, x.moved(share * length, direction)))
        solve.before, solve.trials = solve.last, 0
        found = x, energy, direction, slope, speed, solve.projection, solve.matrix_age or 0
        solve.last = Iteration(*found, at_rounding, factor, min(1.0, length))
        solve.last.meets, solve.last.by_model = solve.meets, is_at_rounding(length * slope, self.potential.scale)
        return length

    def _end_iteration(self, x: Positions) -> str:
        """Records the accepted state x, and chooses the next projection; returns why the solve ends (`stops`), or an
        empty text. Collective.
        """
        solve = self._solve
        last = solve.last
        if last is None:
            return ""
        if solve.trials > 1:
            last.backtracks = solve.trials - 1
            solve.report.backtracks += last.backtracks
        if last.by_model or last.meets:
            solve.projection = "clamp"
        elif last.lengthening == 1.0:  # the quadratic model does not hold for lengthened steps
            kept = fraction_kept(last, x, self._energy(x), self._sum)
            solve.projection = next_projection(kept, last.full, self.linear.detects_indefinite)
            if solve.projection == "none" and solve.unprojected_failed:
                solve.projection, solve.unprojected_failed = "clamp", False
            last.as_promised = TRUSTED <= kept <= TOO_STIFF
        solve.stalled = solve.stalled + 1 if gains_nothing(last, solve.before) else 0
        why = stops(last, solve.before, solve.tolerance)
        return "" if why and self._goes_on(last, why) else why

    def _goes_on(self, last: Iteration, why: str) -> bool:
        """Whether a solve that `stops` would end goes on, because forces do not balance yet. Collective."""
        solve = self._solve
        solve.report.imbalance = self.potential.imbalance(self._free, solve.tolerance * self._dt)
        if why == "ROUNDING" or solve.balancing == STALL or solve.report.imbalance <= BALANCED:
            return False
        solve.balancing += last.speed <= speed_of(solve.before)  # on the way out of a barrier, steps grow
        return True

    # ---- matrices

    def _renew_matrix(self, x: Positions) -> None:
        self._solve.matrix_age = 0
        self._solve.report.hessians += 1
        self.system.sum(x, self._solve.projection)
        self.system.assemble()

    def _leave_unprojected(self) -> bool:
        """After a Hessian that failed: whether it was unprojected. The next one will be projected."""
        if self._solve.projection != "none":
            return False
        self._solve.projection, self._solve.unprojected_failed = "clamp", True
        return True

    def _predict(self, x: Positions, step: PETSc.Vec) -> tuple[np.ndarray, float | None]:
        """Solves for the step again where it brings pairs together (`potentials/contact/barrier.py`) or changes which
        contacts stick (`potentials/contact/friction.py`). Returns the direction of the step, and the part of it that is
        admissible where that is known.

        Where pairs meet, the step that brings them together can go on until the first of them does. It is taken where
        the potential ends lower than by as much of the new step as can be taken.
        """
        raw = before = direction = self._direction(step)
        share = 1.0
        predicts = self.potential.contacts and self._speed(raw) * self._dt < self._far
        for number in range(PREDICTIONS if predicts else 0):
            first, last = number == 0, number + 1 == PREDICTIONS
            change = self.potential.predict(x, direction, first, last)
            if change is None:
                break
            if share == 1.0:
                before, share = direction, self.potential.first_meeting
            self.system.repredict(x)
            right = self._residual.copy()
            right.getArray()[:] += np.where(self.supported[:, None], 0.0, change).ravel()
            self.system.assemble()
            self._solve.report.linear_iterations += self.system.solve(right, step, near=True)
            direction = self._direction(step)
        if direction is raw:
            return raw, None
        meets = self.potential.first_meeting < 1.0
        self.potential.forget_prediction()
        self._solve.matrix_age = None
        free, better = None, self._slope(direction) < 0.0
        if better and share < 1.0:
            alone = self.potential.value(x.moved(share, before))
            free = self.potential.max_step(x, direction)
            end = x.moved(free, direction)
            self._solve.states = [end, x]
            better = self._energy(end) < alone
        if better:
            self._solve.meets = meets
            return direction, free
        direction = before if self._slope(before) < 0.0 else raw
        step.setArray(-direction.ravel())
        return direction, None

    # ---- what callers use

    @property
    def linear(self) -> LinearSolver:
        """What solves its linear systems."""
        return self.system.linear

    def begin_step(self, dt: float) -> None:
        """Sets the length dt [s] of the step that the next solves are for: speeds are distances over dt."""
        self._dt = dt

    def start(self, x: Positions) -> Solve:
        """A new minimisation from x, which the callbacks use from now on."""
        self._solve = Solve([x], self.tolerance, np.zeros_like(x.owned))
        return self._solve

    def solve(
        self, x: Positions, robust: bool = False, max_iterations: int | None = None
    ) -> tuple[Positions, NewtonReport]:
        """Minimises from the admissible x. The result is admissible whether or not the report says it converged.

        Parameters
        ----------
        robust : begin with the strongest projection and the direct solver
        max_iterations : Newton iterations allowed, instead of the settings'

        Raises SimulationError, naming the term, where something is not a number.
        """
        solve = self.start(x)
        if not np.isfinite(self._energy(x)):
            self.potential.require_admissible(x)
        if robust:
            solve.projection = "abs"
            self.linear.use_direct()
        self.snes.setTolerances(max_it=self.settings.max_iterations if max_iterations is None else max_iterations)
        # A direct solve of an ill-conditioned system shows in the linear reason.
        while True:
            self._vector.setArray(x.owned.ravel())
            with own_errors():
                self.snes.solve(None, self._vector)
            x, reason = self._positions(self._vector), self.snes.getConvergedReason()
            solve.report.iterations += self.snes.getIterationNumber()
            solve.report.linear_iterations += self.snes.getLinearSolveIterations()
            if not self.remedy(reason):
                break
        report = solve.report
        report.converged = reason > 0
        try:
            if "NAN" in _REASONS.get(reason, ""):
                self.potential.require_admissible(solve.states[0])  # the last one that was tried
        except SimulationError as error:
            report.reason = str(error)
        report.reason = report.reason or _REASONS.get(reason, str(reason))
        report.gradient_norm = self.space.reduce(float(np.abs(solve.gradient).max(initial=0.0)), MPI.MAX)
        return x, report

    def remedy(self, reason: int) -> bool:
        """After SNES stopped for `reason`: whether a remedy was taken with which the solve can go on from its state.
        The iterations of all restarts together are bounded as those of one solve.
        """
        reasons, solve = PETSc.SNES.ConvergedReason, self._solve
        failures = (reasons.DIVERGED_LINEAR_SOLVE, reasons.DIVERGED_LINE_SEARCH)
        if reason not in failures or solve.report.iterations > self.settings.max_iterations:
            return False
        solve.matrix_age = None
        remedy = self._take_remedy(reason == reasons.DIVERGED_LINEAR_SOLVE)
        if remedy:
            solve.report.remedies[remedy] += 1
        return bool(remedy)

    def _take_remedy(self, linear_solve_failed: bool) -> str:
        """Takes the next remedy; returns its name, empty where none is left."""
        if self._leave_unprojected():
            return "clamp"
        if linear_solve_failed:
            before = self.linear.method
            if not self.linear.fall_back():
                return ""
            return "workspace" if before == "direct" else "direct"
        if self._solve.projection != "abs" and self._solve.stalls < 2:
            self._solve.projection = "abs"
            return "abs"
        return "direct" if self.linear.use_direct() else ""
