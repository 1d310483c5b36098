"""One level's time stepping: space, terms, supports and the solver that takes one step, cutting it where it must."""

import resource
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from mpi4py import MPI
from scipy.sparse import csr_array

from pdvol.errors import ConvergenceError, SimulationError
from pdvol.integrate.motion_parts import follow
from pdvol.integrate.scripted_motion import Script
from pdvol.levels.materials import CellMaterials
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import build_terms
from pdvol.potentials.consistency import Guide
from pdvol.potentials.potential import KEPT, KEPT_PRESSED, Positions
from pdvol.scene import Friction, Scene, metres
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.newton import Newton, NewtonReport
from pdvol.solve.remedies import no_rungs, told
from pdvol.solve.timing import Stopwatch

HELD_BACK = (0.25, 0.0)  # of what motions gained before a solve failed: so far they go when it is tried again


@dataclass
class StepReport:
    """One finished step of one level (design, section 4, `log.jsonl`), with its positions.

    Attributes
    ----------
    positions : (n, d) [m], in the input's vertex order, on every rank
    friction_iterations : how often friction was lagged, over all parts of a step that was cut
    friction_residual : change of the friction forces at the end if they were lagged anew there, relative to them
    kappa : stiffness of the barrier: [Pa], or [N] per contact where its law is not the convergent one
    reached : share of the step's scripted motion that was carried out
    behind : [s] how far scripted motions are behind the time at the step's end, because contact holds them back
    cuts : how often the step was halved
    solver_memory : what the next step's linear solves begin with (`LinearSolver.memory`)
    ladder : how often each rung of the failure ladder was taken (`ladder.py`)
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
    friction_iterations: int = 0
    friction_residual: float | None = None
    kappa: float | None = None
    energy: dict[str, float] = field(default_factory=dict)
    gradient_norm: float = 0.0
    reason: str = ""
    linear_solver: str = ""
    solver_memory: dict = field(default_factory=dict)
    cuts: int = 0
    reached: float = 1.0
    behind: float = 0.0
    ladder: dict[str, int] = field(default_factory=no_rungs)
    seconds: dict[str, float] = field(default_factory=dict)
    peak_memory_mb: float = 0.0

    def record(self) -> dict:
        """What the log keeps: everything but the positions."""
        return {key: value for key, value in vars(self).items() if key != "positions"}


def peak_memory(comm: MPI.Comm) -> float:
    """The most that one rank's process has held so far [MB]. Collective."""
    return round(comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024, op=MPI.MAX), 1)


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
    guides : what holds the level to the coarser one, if anything
    """

    def __init__(
        self,
        scene: Scene,
        space: LevelSpace,
        level: int,
        diagonal: float,
        obstacles=(),
        coarse_weights: Callable[[], csr_array | None] = lambda: None,
        materials: CellMaterials | None = None,
        guides: Sequence[Guide] = (),
    ):
        self.scene, self.space, self.level = scene, space, level
        self.watch = Stopwatch()
        self.potential = IncrementalPotential(
            space, build_terms(scene, space, diagonal, obstacles, materials, guides), self.watch
        )
        self.script = Script(scene, space, level)
        self._diagonal, self._coarse_weights = diagonal, coarse_weights
        self.newton = self._new_newton()
        self._lags, self._settled = next(
            ((c.iterations, c.tolerance) for c in scene.contact if isinstance(c, Friction)), (1, 0.0)
        )

    def _new_newton(self) -> Newton:
        settings, diagonal = self.scene.solver, self._diagonal
        return Newton(
            self.space,
            self.potential,
            self.script.held,
            metres(settings.tolerance, diagonal),
            settings,
            self.watch,
            self._coarse_weights,
        )

    def go_on_from(self, record: Mapping) -> None:
        """Begins with what the step of this log record knew, so that the next one is the same as without an
        interruption.
        """
        behind = record.get("behind", 0.0)
        self.script.behind = float(behind) if isinstance(behind, (int, float)) else 0.0
        if isinstance(record.get("solver_memory"), dict):
            self.newton.linear.recall(record["solver_memory"])

    def step(self, number: int, positions: np.ndarray, velocity: np.ndarray) -> StepReport:
        """Step `number` (from 1) from positions (n, d) with predicted velocity (n, d) [m/s], both in the input's order.

        Raises ConvergenceError, naming level, step and reason, where no rung of the ladder helps, and InputError where
        a motion of the scene's own fails. Collective.
        """
        dt = self.scene.dt
        report = StepReport(self.level, number, number * dt, positions)
        self.newton.forget()
        with self.watch.part("total"):
            x = Positions(self.space, self.space.from_input(positions))
            if self.script.begin((number - 1) * dt):  # other rows are free
                memory = self.newton.linear.memory
                self.newton = self._new_newton()
                self.newton.linear.recall(memory)
            x = self._advance(report, x, self.space.from_input(velocity), (number - 1) * dt, number * dt)
            report.reached, report.behind = self.script.end(number * dt), self.script.behind
            report.positions = x.whole
            report.energy = self.potential.energies(x)
            report.contacts = sum(term.count(x) for term in self.potential.contacts)
            gap = self.potential.min_gap(x)
            report.min_gap = gap if np.isfinite(gap) else None
            report.kappa = next((term.kappa for term in self.potential.contacts), None)
            if self.potential.frictions and report.friction_residual is None:
                report.friction_residual = self.potential.lag(x)  # the next step begins with it anyway
        report.linear_solver, report.solver_memory = self.newton.linear.method, self.newton.linear.memory
        report.seconds = self.watch.report()
        report.peak_memory_mb = peak_memory(self.space.comm)
        return report

    def _advance(
        self, report: StepReport, x_t: Positions, velocity: np.ndarray, t0: float, t1: float, depth: int = 0
    ) -> Positions:
        """From t0 to t1, down the ladder where that does not converge (`ladder.py`)."""
        clock, deepest = self.script.clock, depth == self.scene.solver.max_halvings
        x_hat = x_t.owned + (t1 - t0) * velocity

        def attempt(target: float, careful: bool = False) -> tuple[Positions | None, NewtonReport]:
            self.script.clock = clock
            try:
                x, solved = self._solve(report, x_t, x_hat, t0, t1, target, careful)
            except SimulationError as error:
                raise ConvergenceError(self.level, report.step, str(error)) from None
            if solved.converged:
                report.reason, report.gradient_norm = solved.reason, solved.gradient_norm
            return (x if solved.converged else None), solved

        substeps = report.ladder["substeps"]
        x, solved = attempt(t1)
        if (
            report.ladder["substeps"] > substeps
        ):  # contact stood in the way of motions, which may have crushed what they met
            gained = self.script.clock - clock
            for share in HELD_BACK:
                if x is None:
                    report.ladder["held_back"] += 1
                    x, solved = attempt(clock + share * gained)
        if x is None and deepest:
            report.ladder["last_resort"] += 1
            x, solved = attempt(t1, careful=True)
        if x is not None:
            return x
        if deepest:
            raise ConvergenceError(
                self.level,
                report.step,
                f"{solved.reason} after {report.cuts} cuts of the step, last at dt = {t1 - t0:.3g} s, "
                f"Newton step {solved.speed:.3g} m/s (tried: {told(report.ladder)}); try a smaller dt or a larger dhat",
            )
        report.cuts += 1
        report.ladder["halvings"] += 1
        self.script.clock = clock
        middle = 0.5 * (t0 + t1)
        halfway = self._advance(report, x_t, velocity, t0, middle, depth + 1)
        return self._advance(report, halfway, (halfway.owned - x_t.owned) / (middle - t0), middle, t1, depth + 1)

    def _solve(
        self, report: StepReport, x_t: Positions, x_hat: np.ndarray, t0: float, t1: float, target: float, careful: bool
    ) -> tuple[Positions, NewtonReport]:
        """One try, with scripted motions going no further than their places at `target` [s]."""
        self.potential.begin_step(x_t, x_hat, t0, t1, self.script.clock)
        substeps = report.ladder["substeps"]
        x = None if careful else self._predicted(x_t, x_hat, target)
        if x is None:
            x = (
                follow(self.script, self.potential, self.newton, x_t, target, partial(self._count, report))
                if self.script.moves
                else x_t
            )
        lags, report.friction_residual = 1, None
        keep = KEPT_PRESSED if report.ladder["substeps"] > substeps else KEPT
        while True:
            x, solved = self.newton.solve(x, careful, keep=keep)
            self._count(report, solved)
            if not solved.converged:
                break
            if self.potential.stiffen(x):  # by doubling, up to a bound
                continue
            if lags == self._lags:
                break
            residual = self.potential.lag(x)
            if residual <= self._settled:
                report.friction_residual = residual
                break
            lags += 1
        report.friction_iterations += lags if self.potential.frictions else 0
        return x, solved

    def _predicted(self, x_t: Positions, x_hat: np.ndarray, target: float) -> Positions | None:
        """The predicted state, supports in their places, where the straight way there is free and it is a better start
        than x_t.

        Obstacles and supports then are where target wants them. Under friction x_t is better: nothing has slipped
        there, and Newton zigzags across the kink between sticking and sliding from anywhere else.
        """
        if self.potential.rubs:
            return None
        script = self.script
        start = self.potential.value(x_t) if not script.moves else np.inf
        direction = np.where(script.held[:, None], script.positions(target), x_hat) - x_t.owned
        if self.potential.max_step(x_t, direction, until=target) < 1.0:
            return None
        x = x_t.moved(1.0, direction)
        if not script.moves:
            return x if self.potential.value(x) <= start else None
        self.potential.place(target)
        if not np.isfinite(self.potential.value(x)):
            self.potential.place(script.clock)
            return None
        script.clock = target
        return x

    @staticmethod
    def _count(report: StepReport, solved: NewtonReport) -> None:
        report.newton_iterations += solved.iterations
        report.linear_iterations += solved.linear_iterations
        report.hessians += solved.hessians
        report.backtracks += solved.backtracks
        report.step_cap = min(report.step_cap, solved.step_cap)
        for rung, count in solved.rungs.items():
            report.ladder[rung] += count
