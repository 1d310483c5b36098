"""One level's time stepping: space, terms, supports and the solver that takes one step, cutting it where it must."""

import resource
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_array

from pdvol.errors import ConvergenceError, SimulationError
from pdvol.hierarchy.cell_materials import CellMaterials
from pdvol.hierarchy.level_space import LevelSpace
from pdvol.hierarchy.scene_fields import supported_points
from pdvol.potentials.build import build_terms
from pdvol.potentials.potential import Positions
from pdvol.scene import Friction, Scene, Still, metres
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton, NewtonReport
from pdvol.solve.timing import Stopwatch

DRIVES = 200  # how often a scripted motion may be stopped by contact within one step before it is given up for that step


@dataclass
class StepReport:
    """One finished step of one level (design, section 4, `log.jsonl`), with its positions.

    Attributes
    ----------
    positions : (n, d) [m], in the input's vertex order, on every rank
    reached : share of the step's scripted motion that was carried out
    cuts : how often the step was halved
    solver_memory : what the next step's linear solves begin with (`LinearSolver.memory`)
    """

    level: int
    step: int
    time: float
    positions: np.ndarray
    newton_iterations: int = 0
    linear_iterations: int = 0
    hessians: int = 0
    backtracks: int = 0
    step_cap: float = 1.0
    contacts: int = 0
    min_gap: float | None = None
    energy: dict[str, float] = field(default_factory=dict)
    gradient_norm: float = 0.0
    reason: str = ""
    linear_solver: str = ""
    solver_memory: dict = field(default_factory=dict)
    cuts: int = 0
    reached: float = 1.0
    seconds: dict[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0

    def record(self) -> dict:
        """What the log keeps: everything but the positions."""
        return {key: value for key, value in vars(self).items() if key != "positions"}


class LevelProblem:
    """The incremental potential of one level with its supports. Construction is collective.

    Parameters
    ----------
    scene : Scene
    space : LevelSpace
    level : its number
    diagonal : the scene's diagonal [m]
    obstacles : geometry of the scene's `Rigid` obstacles
    coarse_weights : called when a linear solver wants a coarse space, for weights (n, m) over fewer vertices or None
    materials : of the level's cells; where not given, as if the level were the coarsest
    """

    def __init__(self, scene: Scene, space: LevelSpace, level: int, diagonal: float, obstacles=(),
                 coarse_weights: Callable[[], csr_array | None] = lambda: None, materials: CellMaterials | None = None):
        self.scene, self.space, self.level = scene, space, level
        self.watch = Stopwatch()
        self.potential = IncrementalPotential(space, build_terms(scene, space, diagonal, obstacles, materials), self.watch)
        self._supports = [(supported_points(scene, support, space.mesh, level)[space.owned_points], support.motion) for support in scene.supports]
        self.supported = np.zeros(space.n_owned, dtype=bool)
        for mask, _ in self._supports:
            self.supported |= mask
        self._driven = self._is_driven()
        self.newton = Newton(space, self.potential, self.supported, metres(scene.solver.tolerance, diagonal), scene.solver, self.watch,
                             coarse_weights)
        self._lags = next((c.iterations for c in scene.contact if isinstance(c, Friction)), 1)
        self._rest = space.from_input(space.mesh.points)

    def _is_driven(self) -> bool:
        motions = [motion for _, motion in self._supports] + [o.motion for o in self.scene.obstacles]
        return any(not isinstance(motion, Still) for motion in motions)

    def supported_positions(self, time: float) -> np.ndarray:
        """(n_owned, d): where supported vertices should be at `time` [s]; rest positions elsewhere."""
        target = self._rest.copy()
        for mask, motion in self._supports:
            target[mask] = motion(self._rest[mask], time)
        return target

    def go_on_from(self, record: Mapping) -> None:
        """Begins with what the step of this log record knew, so that the next one is the same as without an interruption."""
        if record.get("solver_memory"):
            self.newton.linear.recall(record["solver_memory"])

    def step(self, number: int, positions: np.ndarray, velocity: np.ndarray) -> StepReport:
        """Step `number` (from 1) from positions (n, d) with predicted velocity (n, d) [m/s], both in the input's order.

        Raises ConvergenceError, naming level, step and reason, where no cut of the step helps. Collective.
        """
        dt = self.scene.dt
        report = StepReport(self.level, number, number * dt, positions)
        self.newton.forget()
        with self.watch.part("total"):
            x = Positions(self.space, self.space.from_input(positions))
            x = self._advance(report, x, self.space.from_input(velocity), (number - 1) * dt, number * dt, 0)
            report.positions = x.whole
            report.energy = self.potential.energies(x)
            report.contacts = sum(term.count(x) for term in self.potential.contacts)
            gap = min((term.min_gap(x) for term in self.potential.contacts), default=np.inf)
            report.min_gap = gap if np.isfinite(gap) else None
        report.linear_solver, report.solver_memory = self.newton.linear.method, self.newton.linear.memory
        report.seconds = self.watch.report()
        peak = self.space.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, op=MPI.MAX)
        report.peak_memory_mb = round(peak, 1)
        return report

    def _advance(self, report: StepReport, x_t: Positions, velocity: np.ndarray, t0: float, t1: float, depth: int) -> Positions:
        """From t0 to t1; in two halves where one does not converge."""
        try:
            x, solved = self._solve(report, x_t, x_t.owned + (t1 - t0) * velocity, t0, t1)
        except SimulationError as error:
            raise ConvergenceError(self.level, report.step, str(error)) from None
        if solved.converged:
            report.reason, report.gradient_norm = solved.reason, solved.gradient_norm
            return x
        if depth == self.scene.solver.max_halvings:
            raise ConvergenceError(self.level, report.step, f"{solved.reason} after {report.cuts} cuts of the step, last at dt = {t1 - t0:.3g} s, "
                                   f"Newton step {solved.speed:.3g} m/s; try a smaller dt or a larger dhat")
        report.cuts += 1
        middle = 0.5 * (t0 + t1)
        halfway = self._advance(report, x_t, velocity, t0, middle, depth + 1)
        return self._advance(report, halfway, (halfway.owned - x_t.owned) / (middle - t0), middle, t1, depth + 1)

    def _solve(self, report: StepReport, x_t: Positions, x_hat: np.ndarray, t0: float, t1: float) -> tuple[Positions, NewtonReport]:
        self.potential.begin_step(x_t, x_hat, t0, t1)
        x = self._predicted(x_t, x_hat, t1)
        if x is None:
            x = x_t
            if self._driven:
                x, reached = self._drive(report, x, t0, t1)
                report.reached = min(report.reached, reached)
        for lag in range(self._lags):
            if lag:
                self.potential.lag(x)
            x, solved = self.newton.solve(x)
            self._count(report, solved)
            if not solved.converged:
                break
        return x, solved

    def _predicted(self, x_t: Positions, x_hat: np.ndarray, t1: float) -> Positions | None:
        """The predicted state, supports in their places, where the straight way there is free and it is a better start than x_t.

        Obstacles and supports then are where t1 wants them. Under friction x_t is better: nothing has slipped there, and Newton zigzags
        across the kink between sticking and sliding from anywhere else.
        """
        if self.potential.rubs:
            return None
        start = self.potential.value(x_t) if not self._driven else np.inf
        direction = np.where(self.supported[:, None], self.supported_positions(t1), x_hat) - x_t.owned
        if self.potential.max_step(x_t, direction, until=t1) < 1.0:
            return None
        x = x_t.moved(1.0, direction)
        if self._driven:
            self.potential.place(t1)
        return x if self.potential.value(x) <= start else None

    def _drive(self, report: StepReport, x: Positions, t0: float, t1: float) -> tuple[Positions, float]:
        """Carries supports and obstacles towards their places at t1 without crossing anything.

        Bodies follow by Newton's direction, or are pushed away by minimising where contact stops the motion. Gives the share reached.
        """
        time = t0
        for _ in range(DRIVES):
            move = np.where(self.supported[:, None], self.supported_positions(t1) - x.owned, 0.0)
            direction = self.newton.direction(x, move)
            step = self.potential.max_step(x, direction, until=t1)
            x = x.moved(step, direction)
            time = t1 if step == 1.0 else time + step * (t1 - time)
            self.potential.place(time)
            if step == 1.0:
                return x, 1.0
            x, solved = self.newton.solve(x)
            self._count(report, solved)
            if not solved.converged:
                break
        return x, (time - t0) / (t1 - t0)

    @staticmethod
    def _count(report: StepReport, solved: NewtonReport) -> None:
        report.newton_iterations += solved.iterations
        report.linear_iterations += solved.linear_iterations
        report.hessians += solved.hessians
        report.backtracks += solved.backtracks
        report.step_cap = min(report.step_cap, solved.step_cap)
