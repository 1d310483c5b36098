"""Projected Newton on an incremental potential by PETSc's SNES, which no other file uses.

The potential is SNES's objective (for backtracking), the gradient its function, the projected Hessian its Jacobian. The
pre-check shortens each step such that nothing crosses or inverts. The callbacks translate between PETSc and
`Minimisation`, which decides.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

import numpy as np
from petsc4py import PETSc
from scipy.sparse import csr_array

from pdvol.errors import PdvolError, SimulationError
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions
from pdvol.scene import Relative, Solver
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.linear.coarse_space import CoarseSpace, grid_weights
from pdvol.solve.linear.solver import LinearSolver, wants_general_matrix
from pdvol.solve.linear.system_matrix import SystemMatrix
from pdvol.solve.minimisation import Minimisation
from pdvol.solve.report import NewtonReport, Stopwatch

# linear solves of one iteration in which friction's states are predicted: more save no Newton iterations (27 balls, 60
# steps: 888 without, 736 with 1, 717 with 2, 710 with 3 and with 6)
PREDICTIONS = 3
MAX_SOLVES = 3  # times the iterations allowed per solve: after more of them no remedy starts it again
# Backtracking by cubic models, which need fewer trials than halving; `max_it` trials: 40 halvings reach round-off.
LINE_SEARCH = {"type": "bt", "order": 3, "max_it": 40}

_REASONS = {value: name for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}


@contextmanager
def _own_errors() -> Iterator[None]:
    """Raises a callback's error instead of PETSc's. PETSc's own errors become `SimulationError`."""
    try:
        yield
    except PETSc.Error as error:
        cause = error.__cause__ or error.__context__
        if isinstance(cause, (PdvolError, KeyboardInterrupt)):
            raise cause from None
        if cause is not None:
            raise
        raise SimulationError(f"PETSc gave up: {str(error).splitlines()[0]}") from error


class Newton:
    """Minimises an `IncrementalPotential` over the vertices that are not held.

    Parameters
    ----------
    potential : IncrementalPotential
    supported : (n_owned,) bool
        Vertices that do not move.
    settings : Solver
        Its tolerance is in m/s.
    coarse_weights : as `Stepper` takes it

    Attributes
    ----------
    linear : LinearSolver
    snes : PETSc.SNES
    tolerance : [m/s]
    """

    def __init__(
        self,
        space: LevelSpace,
        potential: IncrementalPotential,
        supported: np.ndarray,
        settings: Solver,
        watch: Stopwatch,
        coarse_weights: Callable[[], csr_array | None] = lambda: None,
    ):
        if isinstance(settings.tolerance, Relative):
            raise ValueError("Newton's tolerance must be a speed in m/s, not a Relative one")
        self.space, self.potential, self.settings, self.watch = space, potential, settings, watch
        self.tolerance = settings.tolerance
        self._fixed, self._coarse_weights, self._dt = supported, coarse_weights, np.inf
        self._vector, self._residual = space.create_vector(), space.create_vector()
        self._blocks = HessianBlocks(BlockPattern(space))
        self._system = SystemMatrix(space, supported, wants_general_matrix(settings))
        self.snes = self._create_snes()
        self.linear = LinearSolver(self.snes.ksp, settings, self._coarse_space, partial(watch.part, "linear"))
        self._solve: Minimisation

    def _create_snes(self) -> PETSc.SNES:
        snes = PETSc.SNES().create(comm=self.space.comm)
        snes.setType(PETSc.SNES.Type.NEWTONLS)
        snes.setObjective(self._objective)
        snes.setFunction(self._function, self._residual)
        snes.setJacobian(self._jacobian, self._system.shell)
        snes.setLineSearchPreCheck(self._precheck)
        snes.setConvergenceTest(self._test)
        snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=self.settings.max_iterations)
        database, prefix = PETSc.Options(), "pdvol_snes_"
        snes.setOptionsPrefix(prefix)
        for name, value in LINE_SEARCH.items():
            database.setValue(f"{prefix}snes_linesearch_{name}", value)
        snes.setFromOptions()
        for name in LINE_SEARCH:
            database.delValue(f"{prefix}snes_linesearch_{name}")
        return snes

    def _coarse_space(self) -> CoarseSpace:
        """On a coarser level where that has no more vertices than a grid (a larger one costs more than it saves)."""
        weights, own = grid_weights(self.space.mesh), self._coarse_weights()
        if own is not None and own.shape[1] <= weights.shape[1]:
            weights = own
        return CoarseSpace(self.space, weights, self._system.all_supported)

    # ---- callbacks

    def _positions(self, vector: PETSc.Vec) -> Positions:
        return self._solve.positions(vector.getArray(readonly=True).reshape(-1, self.space.dim))

    def _objective(self, snes: PETSc.SNES, vector: PETSc.Vec) -> float:
        return self._solve.objective(self._positions(vector))

    def _function(self, snes: PETSc.SNES, vector: PETSc.Vec, residual: PETSc.Vec) -> None:
        residual.setArray(self._solve.evaluate_gradient(self._positions(vector)).ravel())

    def _jacobian(self, snes: PETSc.SNES, vector: PETSc.Vec, J: PETSc.Mat, P: PETSc.Mat) -> None:
        if not self._solve.keeps_matrix():
            self._renew_matrix(self._positions(vector))

    def _precheck(self, vector: PETSc.Vec, step: PETSc.Vec) -> None:
        """Scales the step so that nothing crosses or inverts; SNES moves by its negative."""
        x = self._positions(vector)
        self.linear.note_iterations(self.snes.ksp.getIterationNumber())
        if self.linear.found_indefinite and self._leave_unprojected():
            self._solve.renew_matrix()
            self._renew_matrix(x)
            self._solve_again(self._residual, step)
        self._predict_friction(x, step)
        direction = -step.getArray(readonly=True).reshape(-1, self.space.dim)
        length = self._solve.begin_iteration(x, direction)
        if length != 1.0:
            step.scale(length)

    def _test(self, snes: PETSc.SNES, iteration: int, norms: tuple[float, float, float]) -> int | None:
        reasons, gradient_norm, report = PETSc.SNES.ConvergedReason, norms[2], self._solve.report
        if np.isnan(gradient_norm):
            return reasons.DIVERGED_FNORM_NAN
        if gradient_norm == 0.0:
            report.speed = 0.0
            return reasons.CONVERGED_FNORM_ABS
        if iteration > 0:
            why = self._solve.end_iteration(self._positions(snes.getSolution()), self.linear.detects_indefinite)
            report.reason = "ROUNDING" if why == "ROUNDING" else report.reason
            if why:
                return reasons.CONVERGED_SNORM_RELATIVE
        return reasons.ITERATING

    # ---- matrices

    def _sum_hessian(self, x: Positions) -> None:
        projection = self._solve.projection
        with self.watch.part("assembly"):
            self._blocks.clear()
            self._blocks.projection = projection.mode
            self.potential.add_hessian(x, 1.0, self._blocks)

    def _renew_matrix(self, x: Positions) -> None:
        self._sum_hessian(x)
        with self.watch.part("linear"):
            self._system.assemble(self._blocks)
            self.linear.set_matrix(self._system)

    def _leave_unprojected(self) -> bool:
        """Whether the Hessian was unprojected; it will be projected for some iterations."""
        before = self._solve.projection
        self._solve.projection = before.after_indefinite()
        return self._solve.projection is not before

    def _solve_again(self, right: PETSc.Vec, step: PETSc.Vec, near: bool = False) -> None:
        """Solves for the step again, with the present matrix; `near` as `LinearSolver.solve` takes it."""
        self.linear.solve(right, step, near)
        self._solve.report.linear_iterations += self.snes.ksp.getIterationNumber()

    def _predict_friction(self, x: Positions, step: PETSc.Vec) -> None:
        """Solves for the step again while it changes which contacts stick (`lagged_friction.py`)."""
        if not self.potential.has_friction:
            return
        first, predicted = step.getArray().copy(), False
        for _ in range(PREDICTIONS):
            direction = -step.getArray(readonly=True).reshape(-1, self.space.dim)
            self._solve.require_finite(direction)
            change = self.potential.predict_friction(x, direction)
            if change is None:
                break
            predicted = True
            self.potential.renew_friction(x, 1.0, self._blocks)
            right = self._residual.copy()
            right.getArray()[:] += np.where(self._fixed[:, None], 0.0, change).ravel()
            with self.watch.part("linear"):
                self._system.assemble(self._blocks)
                self.linear.set_matrix(self._system)
            self._solve_again(right, step, near=True)
        if predicted:
            self.potential.forget_prediction()
            self._solve.drop_matrix()
            if not self._solve.descends(-step.getArray(readonly=True)):
                step.setArray(first)

    # ---- what callers use

    def begin_step(self, dt: float) -> None:
        """Sets the length dt [s] of the step that the next solves are for: speeds are distances over dt."""
        self._dt = dt

    def start(self, x: Positions, gap_share: float = MIN_GAP_SHARE) -> Minimisation:
        """A new minimisation from x, which the callbacks use from now on."""
        relative = self.settings.relative_tolerance
        self._solve = Minimisation(self.potential, self._fixed, x, self._dt, self.tolerance, gap_share, relative)
        return self._solve

    def solve(
        self, x: Positions, robust: bool = False, max_iterations: int | None = None, gap_share: float = MIN_GAP_SHARE
    ) -> tuple[Positions, NewtonReport]:
        """Minimises from the admissible x. The result is admissible whether or not the report says it converged.

        Parameters
        ----------
        robust : begin with the strongest projection and the direct solver
        max_iterations : Newton iterations allowed, instead of the settings'
        gap_share : share of a gap that a step which it ends leaves

        Raises SimulationError, naming the term, where something is not a number.
        """
        solve = self.start(x, gap_share)
        if not np.isfinite(solve.energy(x)):
            self.potential.require_admissible(x)
        if robust:
            solve.projection = solve.projection.strongest()
            self.linear.use_direct()
        self.snes.setTolerances(max_it=self.settings.max_iterations if max_iterations is None else max_iterations)
        # A direct solve of an ill-conditioned system shows in the linear reason.
        while True:
            self._vector.setArray(x.owned.ravel())
            with _own_errors():
                self.snes.solve(None, self._vector)
            x = self._positions(self._vector)
            reason = self.snes.getConvergedReason()
            solve.report.iterations += self.snes.getIterationNumber()
            solve.report.linear_iterations += self.snes.getLinearSolveIterations()
            if not self.remedy(reason):
                break
        report = solve.report
        report.converged = reason > 0
        report.reason = report.reason or _REASONS.get(reason, str(reason))
        report.gradient_norm = solve.gradient_norm()
        return x, report

    def remedy(self, reason: int) -> bool:
        """After SNES stopped for `reason`: whether a remedy was taken with which the solve can go on from its state."""
        reasons, solve = PETSc.SNES.ConvergedReason, self._solve
        failures = (reasons.DIVERGED_LINEAR_SOLVE, reasons.DIVERGED_LINE_SEARCH)
        if reason not in failures or solve.report.iterations > MAX_SOLVES * self.settings.max_iterations:
            return False
        solve.drop_matrix()
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
        strongest = self._solve.projection.strongest()
        if strongest is not self._solve.projection:
            self._solve.projection = strongest
            return "abs"
        return "direct" if self.linear.use_direct() else ""

    def forget(self) -> None:
        """Before a step: drops states of the solver that would change the last digits of a resumed run."""
        self.linear.forget()

    def directions(
        self, x: Positions, supported_move: np.ndarray, push: np.ndarray | float = 0.0
    ) -> Iterator[np.ndarray]:
        """Newton's direction (n_owned, d) at x while supported vertices move by `supported_move` (n_owned, d), and
        other motions add `push` (n_owned, d) [kg m] to the gradient; then the part of it that is due to these motions
        alone. Nothing else may use the matrix between the two.
        """
        solve = self.start(x)
        gradient = self.potential.gradient(x)
        self._sum_hessian(x)
        prescribed = np.where(self._fixed[:, None], supported_move, 0.0)
        with self.watch.part("linear"), _own_errors():
            moved, force = self.space.create_vector(), self.space.create_vector()
            moved.setArray(prescribed.ravel())
            # Free rows get the forces of the supports' motion; then rows and columns of supports are eliminated.
            self._system.assemble(self._blocks, eliminate=False)
            self._system.shell.mult(moved, force)
            motions = -push - force.getArray().reshape(-1, self.space.dim)
            self._system.assemble(self._blocks)
            self.linear.set_matrix(self._system)
        for right in (motions - gradient, motions):
            with _own_errors():
                moved.setArray(np.where(self._fixed[:, None], prescribed, right).ravel())
                self.linear.solve(moved, force)
            found = force.getArray().reshape(-1, self.space.dim).copy()
            solve.require_finite(found)
            yield found
