"""Time marches: generators of step reports (docs/method.md). All but the last solve a step, and differ in the
states that predict x_hat.

| march | x_hat of the step from t to t + dt |
|---|---|
| direct | the integrator's prediction from the level's own states; tracks is this march with a guide |
| progressive | x^t + P (x_hat_c - x_c^t + f), x_hat_c the same of the coarser level's states; guides, feedback |
| embedded | none: the step ends at P x_c^{t+1}, even where that intersects |

With implicit Euler f is zero, and the second line is VelPro, x^t + P (x_c^t - x_c^{t-1}) (paper, eq. 2, 3). With an
integrator of several states f makes the coarser level's forces a mean of five steps (`mean_of_forces`).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pdvol.integrate.integrator import Integrator, Past, State, advance
from pdvol.integrate.stepper import Stepper
from pdvol.levels.prolongation import Prolongation
from pdvol.potentials.consistency import Guide
from pdvol.solve.report import StepReport, Stopwatch

# what the mean adds of a step's forces and of those of the four before it, without unit: with the sum of 0 it keeps
# impulses, with the mean delay of 0 it delays no motion, and a level repeats steps at most 1.052 times (docs/method.md)
ADDED_FORCES = (-0.5, 0.5, 0.25, 0.0, -0.25)
SAME_TIME = 1e-9  # fraction of a step: times nearer to the end of one are that end, since they are sums with round-off


@dataclass(frozen=True, eq=False)
class Start:
    """The start of a march: the last states after `step` steps, in the input's order of vertices, that step's record in
    the log, where there is one, and the records of the steps before it that the integrator uses, newest first.
    """

    step: int
    past: Past
    record: Mapping = field(default_factory=dict)
    earlier: Sequence[Mapping] = ()

    @classmethod
    def at_rest(cls, positions: np.ndarray, velocity: np.ndarray) -> "Start":
        """Step 0, at positions (n, d) [m] with velocity (n, d) [m/s]; no step has led there."""
        return cls(0, (State(positions, velocity),))


def direct(stepper: Stepper, start: Start, steps: int) -> Iterator[StepReport]:
    """Steps of one level by the stepper's integrator, up to step `steps`. Collective."""
    past = start.past
    stepper.go_on_from(start.record, start.earlier)
    for number in range(start.step + 1, steps + 1):
        report = stepper.step(number, past)
        anew = stepper.model.begins_anew(number)
        past = advance(stepper.integrator, past, report.positions, stepper.model.dt, anew, report.struck > 0)
        report.velocity = past[0].velocity
        yield report


def progressive(
    stepper: Stepper, prolongation: Prolongation, coarse: Callable[[int], Past], start: Start, steps: int
) -> Iterator[StepReport]:
    """Steps of a level that the coarser one leads, up to step `steps`. Collective.

    Parameters
    ----------
    coarse : step t -> the past of the coarser level, all of whose steps take dt; up to the end of the step that is
        taken
    """
    past = start.past
    stepper.go_on_from(start.record, start.earlier)
    for number in range(start.step + 1, steps + 1):
        by = led(past[0].positions, coarse(number - 1), prolongation)
        past = past[: len(by)]  # velocities of friction start anew with the prediction
        change = mean_of_forces(stepper.integrator, coarse, number, stepper.model.dt)
        report = stepper.step(number, past, by, None if change is None else prolongation.prolong(change))
        anew = stepper.model.begins_anew(number)
        past = advance(stepper.integrator, past, report.positions, stepper.model.dt, anew=anew)
        report.velocity = past[0].velocity
        yield report


def led(positions: np.ndarray, coarse: Past, prolongation: Prolongation) -> Past:
    """The past by which a coarser level leads a finer one from `positions` (n, d): the same displacements and
    velocities, prolonged. Collective.

    An integrator's prediction is linear, and moves with its states. So from here it is x + P (x_hat_c - x_c).
    """
    prolong, now = prolongation.prolong, coarse[0].positions
    earlier = (State(positions + prolong(each.positions - now), prolong(each.velocity)) for each in coarse[1:])
    return (State(positions, prolong(coarse[0].velocity)), *earlier)


def mean_of_forces(integrator: Integrator, coarse: Callable[[int], Past], number: int, dt: float) -> np.ndarray | None:
    """(n_coarse, d) [m]: what the prediction of step `number` gains where the coarser level's forces are a mean of its
    last five steps, its own one included; None where they are those of one step.

    A step of the coarser level is its prediction less what its forces did, e = x_hat^t - x^{t+1}. By the prediction
    alone a finer level repeats x^{t+1} - x^t + e. An integrator of several states then amplifies what changes from step
    to step: BDF2 23/9 times a level. Before a step that begins anew, forces count as those of that step.
    """
    if integrator.states == 1 or len(coarse(number - 1)) < integrator.states:
        return None
    change, left, weight = np.zeros_like(coarse(number)[0].positions), 0.0, integrator.weight(coarse(number - 1), dt)
    for before, share in enumerate(ADDED_FORCES):
        past, end = coarse(number - before - 1), coarse(number - before)[0].positions
        share = share if len(past) == integrator.states else left
        change += share * weight / integrator.weight(past, dt) * (integrator.predict(past, dt) - end)
        left -= share
        if len(past) < integrator.states:
            break
    return change


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
    integrator: Integrator,
    count: Callable[[np.ndarray, float], int] = lambda positions, time: 0,
) -> Iterator[EmbeddedReport]:
    """The prolonged positions of the level below, up to step `steps`, with velocities by an integrator. Collective.

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
            past = advance(integrator, past, report.positions, dt)
            report.velocity = past[0].velocity
            with watch.part("ccd"):
                report.intersections = count(report.positions, report.time)
        report.measure(watch, prolongation.fine)
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
