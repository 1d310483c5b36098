"""Time marches: generators of step reports. They differ only in the velocity that predicts x_hat (design, section 2).

| march | x_hat of the step from t to t + dt |
|---|---|
| direct | x^t + (x^t - x^{t-1}): implicit Euler |
| progressive | x^t + P (x_c^t - x_c^{t-1}), x_c the coarser level: VelPro (paper, equations 2 and 3) |
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from pdvol.hierarchy.prolongation import Prolongation
from pdvol.solve.level_problem import LevelProblem, StepReport


@dataclass(frozen=True, eq=False)
class Start:
    """Where a march sets out: after `step` steps, at positions (n, d) [m] with velocity (n, d) [m/s], in the input's order.

    `record` is what the log keeps of that step, where there is one.
    """

    step: int
    positions: np.ndarray
    velocity: np.ndarray
    record: Mapping = field(default_factory=dict)


def direct(problem: LevelProblem, start: Start, steps: int) -> Iterator[StepReport]:
    """Implicit Euler on one level up to step `steps`. Collective."""
    positions, velocity = start.positions, start.velocity
    problem.go_on_from(start.record)
    for number in range(start.step + 1, steps + 1):
        report = problem.step(number, positions, velocity)
        velocity = (report.positions - positions) / problem.scene.dt
        positions = report.positions
        yield report


def progressive(problem: LevelProblem, prolongation: Prolongation, coarse_velocity: Callable[[int], np.ndarray], start: Start,
                steps: int) -> Iterator[StepReport]:
    """VelPro on one level up to step `steps`. Collective.

    Parameters
    ----------
    coarse_velocity : step t -> (x_c^t - x_c^{t-1}) / dt, shape (n_coarse, d); the initial velocity for t = 0
    """
    positions = start.positions
    problem.go_on_from(start.record)
    for number in range(start.step + 1, steps + 1):
        report = problem.step(number, positions, prolongation.prolong_positions(coarse_velocity(number - 1)))
        positions = report.positions
        yield report
