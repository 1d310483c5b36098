"""The one SNES file: projected Newton on an incremental potential, its line search and its step caps.

SNES minimises: the potential is its objective (backtracking), the gradient its function, the filtered Hessian its
Jacobian. The pre-check caps each step by what contact and inversion allow. Newton stops when its full step is nowhere
faster than the tolerance [m/s]; that step is still taken. A short step deep inside a barrier says little (Newton on a
logarithm doubles the gap, however far it has to go), so the step must also have been taken in full, follow one that
was, not be longer than it, and not have opened the smallest gap by a fifth.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from scipy.sparse import csr_array

from pdvol.errors import PdvolError, SimulationError
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.block_pattern import BlockPattern
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import KEPT, Positions
from pdvol.scene import Solver
from pdvol.solve.globalization import ModelChoice, lengthening, promised_decrease
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.linear.solver import LinearSolver, wants_general_matrix
from pdvol.solve.linear.coarse_space import CoarseSpace, grid_weights
from pdvol.solve.linear.system_matrix import SystemMatrix
from pdvol.solve.remedies import no_rungs
from pdvol.solve.timing import Stopwatch

# a decrease below this share of the energy cannot be told from round-off: there the quadratic model is trusted
ROUNDING = 1e-13
CANCELLING = 2e-15  # the same for energies that are small differences of large terms: relative to those terms

# Near the end steps are short, and the matrix of the one before is nearly as good as a new one. But what it says of how
# far the end is it says with less right: a looser test showed on demos/ball_on_spike.py as a tolerance four times as
# wide.
LAGGED = 5.0  # times the tolerance: steps shorter than this take the last matrix
HALVED = 0.5  # for longer than once only while each is at most this share of the one before
AGED = 0.25  # of the tolerance: what a step with an older matrix must be shorter than to be the last

# times as large a smallest gap as before tells of a step on its way out of a barrier, where steps are short however far
# the end is
OPENING = 1.2

SETTLING = 1_000.0  # times the tolerance: longer steps may lead to other ends, and are not lengthened

ATTEMPTS = 3  # times the iterations allowed per solve, over all of its mended restarts

_REASONS = {value: name for name, value in vars(PETSc.SNES.ConvergedReason).items() if isinstance(value, int)}


@contextmanager
def _own_errors():
    """What a callback raised, instead of the error PETSc makes of it; PETSc's own errors as errors of the simulation."""
    try:
        yield
    except PETSc.Error as error:
        cause = error.__cause__ or error.__context__
        if isinstance(cause, (PdvolError, KeyboardInterrupt)):
            raise cause from None
        if cause is not None:
            raise
        raise SimulationError(f"PETSc gave up: {str(error).splitlines()[0]}") from error


@dataclass
class NewtonReport:
    """What one solve did.

    Attributes
    ----------
    converged : bool
    reason : PETSc's name of why it stopped; "ROUNDING" where the energy cannot fall any further in double precision
    iterations, linear_iterations, backtracks : int
    hessians : matrices assembled; other iterations took the one before
    step_cap : smallest cap put on a step by contact or inversion
    gradient_norm : infinity norm of the gradient [kg m]
    speed : size of the last full Newton step [m/s]
    rungs : how often each rung of the ladder was taken
    """

    converged: bool = False
    reason: str = ""
    iterations: int = 0
    linear_iterations: int = 0
    hessians: int = 0
    backtracks: int = 0
    step_cap: float = 1.0
    gradient_norm: float = np.inf
    speed: float = np.inf
    rungs: dict[str, int] = field(default_factory=no_rungs)


class Newton:
    """Minimises an `IncrementalPotential` over the unsupported vertices.

    Parameters
    ----------
    potential : IncrementalPotential
    supported : (n_owned,) bool
        Vertices that do not move.
    tolerance : [m/s]
    settings : Solver
    coarse_weights : as `LevelProblem` takes it
    """

    def __init__(
        self,
        space: LevelSpace,
        potential: IncrementalPotential,
        supported: np.ndarray,
        tolerance: float,
        settings: Solver,
        watch: Stopwatch,
        coarse_weights: Callable[[], csr_array | None] = lambda: None,
    ):
        self.space, self.potential, self.tolerance, self.watch = space, potential, tolerance, watch
        self._fixed, self._coarse_weights = supported, coarse_weights
        self._most, self._allowed = settings.max_iterations, ATTEMPTS * settings.max_iterations
        self._vector, self._residual = space.create_vector(), space.create_vector()
        self._blocks, self._system = (
            HessianBlocks(BlockPattern(space)),
            SystemMatrix(space, supported, wants_general_matrix(settings)),
        )
        self._system.assemble(self._blocks)
        self.snes = self._create_snes(settings)
        self.linear = LinearSolver(self.snes.ksp, settings, len(space.mesh.points), self._coarse_space)

    def _create_snes(self, settings: Solver) -> PETSc.SNES:
        snes = PETSc.SNES().create(comm=self.space.comm)
        snes.setType(PETSc.SNES.Type.NEWTONLS)
        snes.setObjective(self._objective)
        snes.setFunction(self._function, self._residual)
        snes.setJacobian(self._jacobian, self._system.petsc)
        snes.setLineSearchPreCheck(self._cap)
        snes.setConvergenceTest(self._test)
        snes.setTolerances(rtol=0.0, atol=0.0, stol=0.0, max_it=settings.max_iterations)
        database = PETSc.Options()
        snes.setOptionsPrefix("pdvol_snes_")
        for name, value in {
            "snes_linesearch_type": "bt",
            "snes_linesearch_order": 3,
            "snes_linesearch_max_it": 40,
        }.items():
            database.setValue(f"pdvol_snes_{name}", value)
        snes.setFromOptions()
        for name in ("type", "order", "max_it"):
            database.delValue(f"pdvol_snes_snes_linesearch_{name}")
        return snes

    def _coarse_space(self) -> CoarseSpace:
        weights = self._coarse_weights()
        return CoarseSpace(
            self.space, grid_weights(self.space.mesh) if weights is None else weights, self._system.all_supported
        )

    # ---- callbacks
    # -----------------------------------------------------------------------------------------------------------

    def _positions(self, vector: PETSc.Vec) -> Positions:
        """The configuration a PETSc vector holds; the last two are kept, so that terms share what they derived from
        them.
        """
        array = vector.getArray(readonly=True).reshape(-1, self.space.dim)
        for known in self._recent:
            if self.space.comm.allreduce(np.array_equal(known.owned, array), op=MPI.LAND):
                return known
        self._recent = [Positions(self.space, array.copy()), *self._recent[:1]]
        return self._recent[0]

    def _energy(self, x: Positions) -> float:
        for known, energy in self._energies:
            if known is x:
                return energy
        energy = self.potential.value(x)
        self._energies = [(x, energy), *self._energies[:1]]
        return energy

    def _objective(self, snes, vector) -> float:
        x = self._positions(vector)
        if x is self._base:
            return self._energy(x)
        self._trials += 1
        return self._base_energy + 0.5 * self._slope if self._at_rounding else self._energy(x)

    def _function(self, snes, vector, residual) -> None:
        gradient = self.potential.gradient(self._positions(vector))
        gradient[self._fixed] = 0.0
        self._gradient = gradient
        residual.setArray(gradient.ravel())

    def _jacobian(self, snes, vector, J, P) -> None:
        if self._last_will_do():
            self._age += 1
            self.linear.follow(self._system.parts)  # it may have changed its mind about how to solve
            return
        self._age, self.report.hessians = 0, self.report.hessians + 1
        self._add_up(self._positions(vector))
        with self.watch.part("linear"):
            self._previous = self._system.petsc  # SNES still holds it while the callback runs
            if self._system.assemble(self._blocks):
                snes.setJacobian(self._jacobian, self._system.petsc)
            self.linear.follow(self._system.parts)

    def _last_will_do(self) -> bool:
        """Whether the last matrix serves for another step.

        Only where steps are short and do not lead out of a barrier: there those by new matrices grow, and by older ones
        shrink, as if the end were near.
        """
        if self._age is None or self._at_rounding or not self._calm:
            return False
        return self._age == 0 or self.report.speed <= HALVED * self._speed_before

    def _add_up(self, x: Positions) -> None:
        self._blocks.clear()
        self._blocks.positive, self._blocks.quick = self._model.positive, self._model.quick
        self.potential.add_hessian(x, 1.0, self._blocks)

    def _cap(self, vector, step) -> None:
        """Scales the step so that nothing crosses or inverts; SNES moves by its negative."""
        x = self._positions(vector)
        if self._model.positive == "none" and self.linear.indefinite and self._model.was_indefinite():
            self._solve_again(x, step)
        direction = -step.getArray(readonly=True).reshape(-1, self.space.dim)
        self._require_finite(direction)
        self.linear.learn(self.snes.ksp.getIterationNumber())
        self._speed_before, self._whole_before = self.report.speed, self._whole
        self.report.speed = self._largest(direction) / self.potential.dt
        slope = self.space.comm.allreduce(float(np.vdot(self._gradient, direction)))
        self._base_energy = self._energy(x)
        if self._is_short():
            self._base_gap = self.potential.min_gap(x)
        self._slope, self._at_rounding = (
            slope,
            abs(slope) <= max(ROUNDING * abs(self._base_energy), CANCELLING * self.potential.scale),
        )
        stretch = self._stretch(x, direction)
        length = stretch * self.potential.max_step(x, stretch * direction, keep=self._keep)
        cap = min(1.0, length)
        self.report.step_cap = min(self.report.step_cap, cap)
        self._last_cap, self._stretched = cap, stretch > 1.0
        self._base, self._trials_before, self._whole, self._direction = x, self._trials, cap == 1.0, direction.copy()
        if length != 1.0:
            step.scale(length)

    def _stretch(self, x: Positions, direction: np.ndarray) -> float:
        """How many times as far to go. Collective."""
        before, self._filtered = self._filtered, self._model.positive != "none"
        if not (before and self._filtered) or self._at_rounding or self.report.speed > SETTLING * self.tolerance:
            return 1.0
        return lengthening(direction, self._direction, x.owned - self._base.owned, self.space.comm.allreduce)

    def _solve_again(self, x: Positions, step: PETSc.Vec) -> None:
        """The same step by the model as it is chosen now."""
        self._age, self.report.hessians = 0, self.report.hessians + 1
        self._add_up(x)
        self._system.assemble(self._blocks)  # at the same x the matrix and its pattern stay
        self.linear.follow(self._system.parts)
        self.linear.solve(self._residual, step)

    def _require_finite(self, direction: np.ndarray) -> None:
        if not self.space.comm.allreduce(bool(np.isfinite(direction).all()), op=MPI.LAND):
            raise SimulationError("the linear solve gave NaN or infinity")

    def _largest(self, rows: np.ndarray) -> float:
        """Largest row length over all ranks."""
        mine = np.sqrt(np.max(np.sum(rows**2, axis=1), initial=0.0))
        return self.space.comm.allreduce(float(mine), op=MPI.MAX)

    def _test(self, snes, iteration, norms) -> int | None:
        _, _, gradient_norm = norms
        reasons = PETSc.SNES.ConvergedReason
        if np.isnan(gradient_norm):
            return reasons.DIVERGED_FNORM_NAN
        if gradient_norm == 0.0:
            self.report.speed = 0.0
            return reasons.CONVERGED_FNORM_ABS
        if iteration > 0:
            backtracks = max(0, self._trials - self._trials_before - 1)
            self.report.backtracks += backtracks
            self._whole = self._whole and backtracks == 0
            self._choose_model(snes)
            self._calm = self._whole and self._is_short() and not self._opens(self._positions(snes.getSolution()))
            settled = self._calm and self._whole_before and self.report.speed <= self._speed_before
            if self.report.speed <= (AGED if self._age else 1.0) * self.tolerance and (settled or self._at_rounding):
                return reasons.CONVERGED_SNORM_RELATIVE
            if self._at_rounding and self.report.speed > 0.5 * self._speed_before:
                self.report.reason = "ROUNDING"
                return reasons.CONVERGED_SNORM_RELATIVE
        return reasons.ITERATING

    def _is_short(self) -> bool:
        return self.report.speed <= LAGGED * self.tolerance

    def _opens(self, x: Positions) -> bool:
        """Whether the step to x was one out of a barrier."""
        return self.potential.min_gap(x) > OPENING * self._base_gap

    def _choose_model(self, snes) -> None:
        if self._at_rounding:
            self._model.at_rounding()
            return
        if self._stretched:  # beyond what a model promises
            return
        x = self._positions(snes.getSolution())
        promised = promised_decrease(
            self._slope, x.owned - self._base.owned, self._direction, self.space.comm.allreduce
        )
        self._model.took(
            promised, self._energy(x) - self._base_energy, self._whole, self._last_cap, self.linear.notices_indefinite
        )

    # ---- what callers use
    # ----------------------------------------------------------------------------------------------------

    def solve(
        self, x: Positions, careful: bool = False, most: int | None = None, keep: float = KEPT
    ) -> tuple[Positions, NewtonReport]:
        """Minimises from the admissible x. The result is admissible whether or not the report says it converged.

        Parameters
        ----------
        careful : begin with the strongest filter and the direct solver
        most : Newton iterations allowed, instead of the settings'
        keep : share of a gap that a step which it ends leaves

        Raises SimulationError, naming the term, where something is not a number.
        """
        self._start(x)
        self._keep = keep
        if not np.isfinite(self._energy(x)):
            self.potential.require_admissible(x)
        if careful:
            self._model.be_careful()
            self.linear.be_exact()
        self.snes.setTolerances(max_it=self._most if most is None else most)
        # A direct solve of an ill-conditioned system, or an incomplete factor that breaks down, shows in the linear
        # reason.
        while True:
            self._vector.setArray(x.owned.ravel())
            with self.watch.part("linear"), _own_errors():
                self.snes.solve(None, self._vector)
            x = self._positions(self._vector)
            reason = self.snes.getConvergedReason()
            self.report.iterations += self.snes.getIterationNumber()
            self.report.linear_iterations += self.snes.getLinearSolveIterations()
            if not self._mend(reason):
                break
        self.report.converged = reason > 0
        self.report.reason = self.report.reason or _REASONS.get(reason, str(reason))
        self.report.gradient_norm = self.space.comm.allreduce(
            float(np.abs(self._gradient).max(initial=0.0)), op=MPI.MAX
        )
        return x, self.report

    def _mend(self, reason: int) -> bool:
        """After SNES stopped for `reason`: whether something was changed that makes it worth going on from where it is."""
        reasons = PETSc.SNES.ConvergedReason
        if (
            reason not in (reasons.DIVERGED_LINEAR_SOLVE, reasons.DIVERGED_LINE_SEARCH)
            or self.report.iterations > self._allowed
        ):
            return False
        self._age, rung = None, ""
        if self._model.was_indefinite():
            rung = "clamp"
        elif reason == reasons.DIVERGED_LINEAR_SOLVE:
            before = self.linear.method
            if self.linear.fall_back():
                rung = "workspace" if before == "direct" else "direct" if self.linear.method == "direct" else "shift"
        elif self._model.be_careful():
            rung = "abs"
        elif self.linear.be_exact():
            rung = "direct"
        if rung:
            self.report.rungs[rung] += 1
        return bool(rung)

    def forget(self) -> None:
        """Before a step: drops what its last digits must not depend on, or a resumed run would be another."""
        self._system.forget()
        self.linear.forget()

    def directions(
        self, x: Positions, supported_move: np.ndarray, push: np.ndarray | float = 0.0
    ) -> Iterator[np.ndarray]:
        """Newton's direction (n_owned, d) at x while supported vertices move by `supported_move` (n_owned, d), and
        other motions add `push` (n_owned, d) [kg m] to the gradient; then what of it is due to these motions alone.
        Nothing else may use the matrix between the two.
        """
        self._start(x)
        gradient = self.potential.gradient(x)
        self._add_up(x)
        prescribed = np.where(self._fixed[:, None], supported_move, 0.0)
        with self.watch.part("linear"), _own_errors():
            moved, force = self.space.create_vector(), self.space.create_vector()
            moved.setArray(prescribed.ravel())
            # The free rows see what the supports do; then rows and columns of supports are eliminated.
            self._system.assemble(self._blocks, eliminate=False)
            self._system.petsc.mult(moved, force)
            motions = -push - force.getArray().reshape(-1, self.space.dim)
            self._system.assemble(self._blocks)
            self.snes.setJacobian(self._jacobian, self._system.petsc)
            self.snes.ksp.setOperators(self._system.petsc)
        for right in (motions - gradient, motions):
            with self.watch.part("linear"), _own_errors():
                moved.setArray(np.where(self._fixed[:, None], prescribed, right).ravel())
                self.linear.follow(self._system.parts)  # it may have changed its mind about how to solve
                self.linear.solve(moved, force)
            found = force.getArray().reshape(-1, self.space.dim).copy()
            self._require_finite(found)
            yield found

    def _start(self, x: Positions) -> None:
        self._recent, self._energies, self._base, self._base_energy, self._base_gap = [x], [], None, 0.0, np.inf
        self._model, self._age = ModelChoice(), None
        self._trials = self._trials_before = 0
        self._stretched, self._filtered, self._direction = False, False, None
        self._slope, self._at_rounding, self._whole, self._whole_before, self._speed_before = (
            0.0,
            False,
            True,
            True,
            np.inf,
        )
        self._calm = False
        self._gradient = np.zeros_like(x.owned)
        self.report = NewtonReport()
