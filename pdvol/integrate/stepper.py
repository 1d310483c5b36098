"""One level's steps: prediction, scripted motion, Newton solves with friction lagged anew.

A step that does not converge is halved, down to a bound (`solve/report.py` has the order of remedies).
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from pdvol.errors import ConvergenceError, SimulationError
from pdvol.integrate.feedback import Push
from pdvol.integrate.integrator import Integrator, Past, rates_of
from pdvol.integrate.long_step import LongStep, Show
from pdvol.integrate.scripted_motion import MotionParts, ScriptedMotion
from pdvol.levels.model import LevelModel
from pdvol.levels.script import Mover, Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.build import MakeTerm, build_terms
from pdvol.potentials.consistency import Guide
from pdvol.potentials.potential import Positions, Rates
from pdvol.registry import INTEGRATORS
from pdvol.solve.incremental_potential import IncrementalPotential
from pdvol.solve.iteration import BALANCED, STALL
from pdvol.solve.newton import Newton
from pdvol.solve.newton_system import NewtonSystem
from pdvol.solve.report import NewtonReport, StepReport, Stopwatch, taken


def _lateness(record: Mapping) -> tuple[float, Mapping[str, float]]:
    """`behind` and `late` of a step's log record."""
    behind, late = record.get("behind", 0.0), record.get("late", {})
    return float(behind) if isinstance(behind, (int, float)) else 0.0, late if isinstance(late, dict) else {}


@dataclass(frozen=True, eq=False)
class Span:
    """The part of a step that is solved at once.

    Attributes
    ----------
    start : Positions
    x_hat : (n_owned, d) predicted positions [m]
    weight : of the potential [s^2]
    t0, t1 : its ends [s]
    rates : how rates of change follow from its end; means over it where that is None
    """

    start: Positions
    x_hat: np.ndarray
    weight: float
    t0: float
    t1: float
    rates: Rates | None = None

    @classmethod
    def euler(cls, start: Positions, velocity: np.ndarray, t0: float, t1: float) -> "Span":
        """One step of implicit Euler, which needs no constant steps, with velocity (n_owned, d) [m/s] at its start."""
        return cls(start, start.owned + (t1 - t0) * velocity, (t1 - t0) ** 2, t0, t1)


@dataclass(frozen=True)
class FromCoarser:
    """What a level's steps take from coarser levels.

    Attributes
    ----------
    weights : called when a linear solver needs a coarse space, gives weights (n, m) over fewer vertices or None
    guides : that hold the level to the coarser one
    feedback : pushes against the drift from the coarser level
    """

    weights: Callable[[], csr_array | None] = lambda: None
    guides: Sequence[Guide] = ()
    feedback: Sequence[Push] = ()


ALONE = FromCoarser()


class Stepper:
    """Takes the time steps of one level. Construction is collective.

    Parameters
    ----------
    model : LevelModel
    space : LevelSpace
    coarser : FromCoarser
    integrator : Integrator; the model's where not given
    terms : make further terms of the energy
    forces : whether reports have the terms' forces
    show : what `LongStep` calls while a step lasts

    Attributes
    ----------
    potential : IncrementalPotential
    motion : ScriptedMotion
    newton : Newton
    """

    def __init__(
        self,
        model: LevelModel,
        space: LevelSpace,
        coarser: FromCoarser = ALONE,
        integrator: Integrator | None = None,
        terms: Sequence[MakeTerm] = (),
        forces: bool = False,
        show: Show | None = None,
    ):
        self.model, self.space, self.integrator = model, space, integrator or INTEGRATORS[model.integrator]()
        self.watch = Stopwatch()
        script = Script(model.supports, model.obstacles, model.ground)
        built = build_terms(model, space, coarser.guides, script, terms)
        self.potential = IncrementalPotential(space, built, self.watch, model.bodies)
        self.motion, self._script = ScriptedMotion(space, script, model.start, model.dt), script
        states = self.integrator.states
        self._lags = deque[Mapping[Mover, float]]([{}] * states, maxlen=states)  # at steps' starts, newest first
        self._coarse_weights, self._feedback = coarser.weights, coarser.feedback
        self._long = None if show is None else LongStep(self.potential, show)
        self.newton = self._new_newton()
        self._struck, self._reports_forces = 0, forces
        self._stuck: Positions | None = None  # where the last solve that failed has ended
        self._end: Positions | None = None  # of the last solved step: terms know what they have found there
        self._first_lag = False  # whether this is a scene's first step, and friction acts at its start
        self._friction = next(((f.iterations, f.tolerance) for f in model.friction), (1, 0.0))

    def _new_newton(self) -> Newton:
        iterated = (lambda x, iterations: None) if self._long is None else self._long.iterated
        return Newton(NewtonSystem(self.potential, self.motion.held, self.model.solver, self._coarse_weights), iterated)

    def go_on_from(self, record: Mapping, earlier: Sequence[Mapping] = ()) -> None:
        """Restores the solver's memory from a step's log record, so that the next step is the same as without an
        interruption; `earlier` are records of the steps before it, newest first, as many as the integrator uses.
        """
        self.motion.go_on_from(*_lateness(record))
        for each in reversed(earlier):
            self._lags.appendleft(self._script.recorded_lags(*_lateness(each)))
        if isinstance(record.get("solver_memory"), dict):
            self.newton.linear.restore(record["solver_memory"])
        self.potential.restore(record.get("terms", {}))
        self._struck = int(record.get("struck", 0))

    def step(self, number: int, past: Past, led: Past = (), change: np.ndarray | None = None) -> StepReport:
        """Step `number` (from 1) from the last states, in the input's order of vertices.

        Parameters
        ----------
        led : where another level leads this one, the past by which the step is predicted instead of its own
            (`marches.led`)
        change : (n, d) [m] added to that prediction

        Raises ConvergenceError, naming level, step and reason, where no remedy helps, and InputError where a function
        of the scene fails. Collective.
        """
        dt = self.model.dt
        report = StepReport(self.model.level, number, number * dt, past[0].positions, past[0].velocity)
        self.newton.linear.begin_step()
        if self._long is not None:
            self._long.begin(report)
        with self.watch.part("total"):
            released = self.motion.begin((number - 1) * dt)
            self._lags.appendleft(self.motion.lags)
            if released:  # other rows are free
                memory = self.newton.linear.memory
                self.newton = self._new_newton()
                self.newton.linear.restore(memory)
            x = self._end = self._advance(report, *self._whole(past, led or past, number, change))
            # What pushes for longer than one step more than the integrator has states is no blow.
            strikes = not led and self._struck <= self.integrator.states and self._strikes(report, past, x)
            report.struck = self._struck = self._struck + 1 if strikes else 0
            report.reached, report.behind, report.late = self.motion.end()
            self._measure(report, x)
            self.potential.end_step(x)
        report.terms = self.potential.memory
        report.linear_solver, report.solver_memory = self.newton.linear.method, self.newton.linear.memory
        report.measure(self.watch, self.space)
        return report

    def _whole(self, past: Past, by: Past, number: int, change: np.ndarray | None) -> tuple[Span, np.ndarray]:
        """The span of a whole step from its past, predicted `by` another one; and the velocities with which a part of
        it would begin.
        """
        integrator, rows, start = self.integrator, self.space.from_input, number - 1
        t0, t1 = start * self.model.dt, number * self.model.dt
        x_t, predicted, dt = past[0].positions, tuple(state.rows(rows) for state in by), t1 - t0
        if self._end is None or self._end.whole is not x_t:
            self._end = Positions(self.space, rows(x_t))
        x_hat, velocity = integrator.predict(predicted, dt), predicted[0].velocity
        pushes = [push(start, x_t) for push in self._feedback]
        for push in map(rows, pushes if change is None else [*pushes, change]):
            x_hat, velocity = x_hat + push, velocity + push / dt
        rates = rates_of(integrator, past, self.space, t0, dt, tuple(self._lags)[1:])
        return Span(self._end, x_hat, integrator.weight(predicted, dt), t0, t1, rates), velocity

    def _strikes(self, report: StepReport, past: Past, x: Positions) -> bool:
        """Whether contact struck in a step from the past to x that was solved by implicit Euler instead of an
        integrator of several states. It does where it changes a body's momentum by more than it bears against other
        forces: contact that bears as much as before is no blow. Cut steps are taken for blows where anything touches.
        """
        if self.integrator.states == 1 or not self.potential.contacts:
            return False
        if report.cuts:
            return sum(term.count(x) for term in self.potential.contacts) > 0
        if len(past) == self.integrator.states:
            return False
        dt, (start, velocity) = self.model.dt, map(self.space.from_input, vars(past[0]).values())
        push = -dt * sum(term.gradient(x) for term in (*self.potential.contacts, *self.potential.frictions))
        gained = self.potential.mass * ((x.owned - start) / dt - velocity)
        bodies = self.potential.rows_of_bodies()
        push, gained = (self.space.reduce(bodies @ each) for each in (push, gained))
        return bool(np.any(np.sum(push * gained, axis=1) > 0.5 * np.sum(push**2, axis=1)))

    def _measure(self, report: StepReport, x: Positions) -> None:
        report.positions = x.whole
        if self._first_lag and report.friction_residual is None:  # at its end, as `Replay` takes it
            report.friction_residual = self.potential.update_lag(x)
        report.energy = self.potential.energies(x)
        if self._reports_forces:  # before friction is lagged anew: these balance each other
            report.forces = self.potential.forces(x)
        report.contacts = sum(term.count(x) for term in self.potential.contacts)
        gap = self.potential.min_gap(x)
        report.min_gap = gap if np.isfinite(gap) else None
        report.kappa = next((term.kappa for term in self.potential.contacts), None)
        if self.potential.frictions and report.friction_residual is None:
            report.friction_residual = self.potential.update_lag(x)  # the next step starts with the same lag

    def _advance(self, report: StepReport, span: Span, velocity: np.ndarray, depth: int = 0) -> Positions:
        """The state at the end of a span, which was halved `depth` times; its halves would begin with a velocity
        (n_owned, d) [m/s]. Collective.

        Raises ConvergenceError where halving the step `max_halvings` times does not help.
        """
        lags, deepest = self.motion.lags, depth == self.model.solver.max_halvings
        x, solved = self._try(report, span, lags)
        if x is None and deepest:
            report.remedies["last_resort"] += 1
            x, solved = self._try(report, span, lags, robust=True)
        if x is not None:
            return x
        if deepest:
            names = (*self.model.bodies, *(obstacle.name for obstacle in self.model.obstacles))
            gaps = [term.pinched(self._stuck, names) for term in self.potential.contacts] if self._stuck else []
            gap = "".join(f", smallest gap {text}" for text in gaps if text)
            raise ConvergenceError(
                report.level,
                report.step,
                f"{solved.reason} after {report.cuts} cuts of the step, last at dt = {span.t1 - span.t0:.3g} s, Newton"
                f" step {solved.speed:.3g} m/s{gap} (tried: {taken(report.remedies)}); try a smaller dt or a larger"
                " dhat",
            )
        report.cuts += 1
        report.remedies["halvings"] += 1
        self.motion.begin_span(span.t0, span.t1, lags)
        middle = 0.5 * (span.t0 + span.t1)
        halfway = self._advance(report, Span.euler(span.start, velocity, span.t0, middle), velocity, depth + 1)
        velocity = (halfway.owned - span.start.owned) / (middle - span.t0)
        return self._advance(report, Span.euler(halfway, velocity, middle, span.t1), velocity, depth + 1)

    def _try(
        self, report: StepReport, span: Span, lags: Mapping[Mover, float], robust: bool = False
    ) -> tuple[Positions | None, NewtonReport]:
        """The state at a span's end, or None; motions set out late by their `lags` [s]. A `robust` try begins with the
        strongest projection and the direct solver.
        """
        self.motion.begin_span(span.t0, span.t1, lags)
        try:
            x, solved = self._solve(report, span, robust)
        except SimulationError as error:
            raise ConvergenceError(self.model.level, report.step, str(error)) from None
        if not solved.converged:
            self._stuck = x
            return None, solved
        report.reason, report.gradient_norm, report.imbalance = solved.reason, solved.gradient_norm, solved.imbalance
        return x, solved

    def _solve(self, report: StepReport, span: Span, robust: bool) -> tuple[Positions, NewtonReport]:
        x_t, x_hat, motion = span.start, span.x_hat, self.motion
        self.potential.begin_step(x_t, x_hat, span.weight, span.t0, span.t1, span.rates)
        most, tolerance = self._friction
        self._first_lag = span.t0 == 0.0 and self.potential.has_friction
        if self._first_lag:  # no solve has led here: barriers are those of the scene's gaps, not of what bodies bear
            most, tolerance = max(most, STALL), BALANCED if most == 1 else tolerance
            for friction in self.potential.frictions:
                friction.forget_lag()
        self.newton.begin_step(span.t1 - span.t0)
        x = None if robust else self._predicted(x_t, x_hat)
        if x is None:
            x = MotionParts(motion, self.potential, self.newton, report.add).follow(x_t) if motion.moves else x_t
        if not self._end_motion():
            return x, NewtonReport(reason="GROUND_BLOCKED")
        return self._solve_lagged(report, x, robust, most, tolerance)

    def _end_motion(self) -> bool:
        """Lets what has not reached the span's end wait; returns whether the ground is there."""
        motion = self.motion
        motion.stop(motion.going() if motion.clock < motion.end_of_span else ())
        if motion.clock < motion.end_of_span and not motion.moves:
            motion.clock = motion.end_of_span
            self.potential.move_obstacles(motion.clock)
        return motion.clock == motion.end_of_span

    def _solve_lagged(
        self, report: StepReport, x: Positions, robust: bool, most: int, tolerance: float
    ) -> tuple[Positions, NewtonReport]:
        """Newton solves from x, at most `most`, friction lagged anew while that changes more than `tolerance`."""
        lags, report.friction_residual = 1, None
        while True:
            x, solved = self.newton.solve(x, robust)
            report.add(solved)
            if not solved.converged:
                break
            if lags == most:
                break
            residual = self.potential.update_lag(x)
            if residual <= tolerance:
                report.friction_residual = residual
                break
            lags += 1
        report.friction_iterations += lags if self.potential.frictions else 0
        return x, solved

    def _predicted(self, x_t: Positions, x_hat: np.ndarray) -> Positions | None:
        """The predicted state, supports in their places, where the straight path there is free and it is a better start
        than x_t. Obstacles and supports then are at their places at the span's end.
        """
        motion, t1 = self.motion, self.motion.end_of_span
        start = self.potential.value(x_t) if not motion.moves else np.inf
        direction = np.where(motion.held[:, None], motion.positions(t1), x_hat) - x_t.owned
        if self.potential.max_step(x_t, direction, until=t1) < 1.0:
            return None
        x = x_t.moved(1.0, direction)
        if not motion.moves:
            return x if self.potential.value(x) <= start else None
        self.potential.move_obstacles(t1)
        if not np.isfinite(self.potential.value(x)):
            self.potential.move_obstacles(motion.clock)
            return None
        motion.clock = t1
        return x
