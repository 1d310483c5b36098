"""Newton's direction where obstacles move on, supports prescribe places, and what touches obstacles goes along."""

from collections.abc import Mapping

import numpy as np

from pdvol.levels.script import Obstacle
from pdvol.potentials.potential import Positions
from pdvol.solve.callbacks import own_errors
from pdvol.solve.newton import PREDICTIONS, Newton
from pdvol.solve.report import NewtonReport


def prescribed_direction(
    newton: Newton, x: Positions, along: Mapping[Obstacle, np.ndarray], path: np.ndarray, until: float
) -> tuple[np.ndarray, np.ndarray, float, NewtonReport]:
    """Newton's direction from x where obstacles move to their places at `until` [s], and supported vertices and the
    rows that go `along` with obstacles take a `path` (n_owned, d). Collective.

    Bodies stick to each other where they touch, so they can be followed over a longer way; what slides does so in the
    step's own solve. Pairs that meet on the way are predicted. Where their vertices go with different obstacles, these
    are let go.

    Returns
    -------
    direction : (n_owned, d) [m]
        Of those that the predictions gave, the one that is admissible the furthest.
    fixed : (n_owned,) bool
        Rows of it that were prescribed.
    free : the admissible part of it
    report : NewtonReport, of one iteration
    """
    potential, system, supported = newton.potential, newton.system, newton.supported
    report, fixed = NewtonReport(iterations=1, hessians=1), supported.copy()
    fixed[np.concatenate([np.zeros(0, int), *along.values()])] = True
    gradient, change = potential.gradient(x), np.zeros_like(x.owned)
    system.sum(x, "clamp")
    system.stick(x)
    right, step = (newton.space.create_vector() for _ in range(2))
    best, chosen, most = np.zeros_like(x.owned), fixed, -1.0
    try:
        for number in range(PREDICTIONS + 1):
            prescribed = np.where(fixed[:, None], path, 0.0)
            with own_errors():
                # Free rows get the forces of the prescribed motion; then rows and columns of these are eliminated.
                forces = -gradient - change - system.prescribe(fixed, prescribed)
                system.assemble()
                right.setArray(np.where(fixed[:, None], 0.0, forces).ravel())  # no metres beside forces
                report.linear_iterations += system.solve(right, step, near=number > 0)
            direction = prescribed + step.getArray().reshape(gradient.shape)
            newton.require_finite(direction)
            free = potential.max_step(x, direction, until=until)
            if free > most:
                best, chosen, most = direction, fixed.copy(), free
            if free == 1.0 or number == PREDICTIONS:
                break
            more = potential.predict(x, direction, False, number + 1 == PREDICTIONS, until)
            if more is None:
                break
            change = more
            fixed &= ~potential.torn(along) | supported
            system.repredict(x)
    finally:
        potential.forget_prediction()
        system.release()
    newton.iterated(x, 1)
    return best, chosen, most, report
