"""Time marches: generators of step reports (design, section 2). All but the last solve a step, and differ in the
velocity that predicts x_hat.

| march | x_hat of the step from t to t + dt |
|---|---|
| direct | x^t + (x^t - x^{t-1}) with implicit Euler; tracks is this march with a guide |
| progressive | x^t + P (x_c^t - x_c^{t-1}), x_c the coarser level: VelPro (paper, eq. 2, 3); guides, feedback |
| embedded | none: the step ends at P x_c^{t+1}, even where that intersects |
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pdvol.integrate.integrator import ImplicitEuler, Past, State, advance
from pdvol.integrate.stepper import Stepper
from pdvol.levels.prolongation import Prolongation
from pdvol.potentials.consistency import Guide
from pdvol.solve.report import StepReport, Stopwatch, peak_memory

SAME_TIME = 1e-9  # fraction of a step: times nearer to the end of one are that end, since they are sums with round-off


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a march: the last states after `step` steps, in the input's order of vertices, and that step's
    record in the log, where there is one.
    """

    step: int
    past: Past
    record: Mapping = field(default_factory=dict)

    @classmethod
    def at_rest(cls, positions: np.ndarray, velocity: np.ndarray) -> "Start":
        """Step 0, at positions (n, d) [m] with velocity (n, d) [m/s]; no step has led there."""
        return cls(0, (State(positions, velocity),))


def direct(stepper: Stepper, start: Start, steps: int) -> Iterator[StepReport]:
    """Steps of one level by the stepper's integrator, up to step `steps`. Collective."""
    past = start.past
    stepper.go_on_from(start.record)
    for number in range(start.step + 1, steps + 1):
        report = stepper.step(number, past)
        past = advance(stepper.integrator, past, report.positions, stepper.model.dt, report.joined)
        report.velocity = past[0].velocity
        yield report


def progressive(
    stepper: Stepper,
    prolongation: Prolongation,
    coarse_velocity: Callable[[int], np.ndarray],
    start: Start,
    steps: int,
) -> Iterator[StepReport]:
    """VelPro on one level up to step `steps`. Collective.

    Parameters
    ----------
    coarse_velocity : step t -> (x_c^t - x_c^{t-1}) / dt, shape (n_coarse, d); the initial velocity for t = 0
    """
    past = start.past
    stepper.go_on_from(start.record)
    for number in range(start.step + 1, steps + 1):
        velocity = prolongation.prolong(coarse_velocity(number - 1))
        report = stepper.step(number, (State(past[0].positions, velocity),), keeps_velocity=False)
        past = advance(stepper.integrator, past, report.positions, stepper.model.dt, report.joined)
        report.velocity = past[0].velocity
        yield report


@dataclass
class EmbeddedReport(StepReport):
    """One step of an embedded level; nothing was minimised, so it has no energies.

    Attributes
    ----------
    intersections : pairs of edges (2D) or of edges and triangles (3D) that cross, and vertices behind planes; 0 in
        scenes without contact
    """

    intersections: int = 0


def embedded(
    prolongation: Prolongation,
    coarse_positions: Callable[[int], np.ndarray],
    level: int,
    start: Start,
    steps: int,
    dt: float,
    count: Callable[[np.ndarray, float], int] = lambda positions, time: 0,
) -> Iterator[EmbeddedReport]:
    """The prolonged positions of the level below, up to step `steps`. Collective.

    Parameters
    ----------
    coarse_positions : step t -> x_c^t (n_coarse, d) [m]
    count : positions (n, d) [m] and time [s] -> number of intersections there
    """
    watch, past = Stopwatch(), start.past
    for number in range(start.step + 1, steps + 1):
        report = EmbeddedReport(level, number, number * dt, past[0].positions, past[0].velocity, reason="EMBEDDED")
        with watch.part("total"):
            report.positions = prolongation.prolong(coarse_positions(number))
            past = advance(ImplicitEuler(), past, report.positions, dt)
            report.velocity = past[0].velocity
            with watch.part("ccd"):
                report.intersections = count(report.positions, report.time)
        report.seconds, report.peak_memory_mb = watch.report(), peak_memory(prolongation.fine.comm)
        yield report


def guide(weight: float, dt: float, prolongation: Prolongation, coarse_positions: Callable[[int], np.ndarray]) -> Guide:
    """The guide that pulls a level towards P x_c with the weight w of the design's section 2. Within a coarse step x_c
    is linear in time.

    Parameters
    ----------
    coarse_positions : step t -> x_c^t (n_coarse, d) [m]
    """

    def target(time: float) -> np.ndarray:
        step = int(np.floor(time / dt + SAME_TIME))
        share = time / dt - step
        positions = coarse_positions(step)
        if share > SAME_TIME:
            positions = (1.0 - share) * positions + share * coarse_positions(step + 1)
        return prolongation.prolong(positions)

    return Guide(weight / dt**2, target)
