"""The record of one Newton iteration, and the rules that follow from the last two: when to stop, when to keep the
matrix, how to make the next Hessian positive definite, how long the next step is.

Newton stops when its full step is nowhere faster than the tolerance [m/s]; that step is still taken. A short step says
little about the distance to the minimum within the smoothing of friction, which is as wide as the default tolerance
(where a contact begins to slide its stiffness vanishes), deep inside a barrier, or by an older matrix in a soft
direction. In a stiff contact it moves nothing and still changes forces. So forces must balance, too: what is left of
the gradient is small beside the largest force on each body (`IncrementalPotential.imbalance`).

The next projection follows from how well the last model promised the decrease (in the spirit of Chen et al. 2024):

| the model promised | the next Hessian |
|---|---|
| about the actual decrease | negative eigenvalues of local Hessians cut off: the nearest positive one |
| much more | negative eigenvalues by size, which overshoots less |
| much less | unprojected, since cutting off made it too stiff; cut off where that is indefinite, and once more |

Where the Hessian is indefinite every projected one is too stiff: step after step has the same direction, each a few per
cent shorter than the last. The second of them shows the stiffness in that direction, and so the length of the whole
series (a secant).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count

import numpy as np

from pdvol.potentials.potential import Positions
from pdvol.solve.report import NewtonReport

Sum = Callable[[np.ndarray], np.ndarray]
"""Sums an array over all ranks."""

TRUSTED = 0.5  # fraction of the decrease that a model promised, and of its stiffness: below it the model is too far off
TOO_STIFF = 1.25  # times the promised decrease: a model that delivers more is too stiff

# cosine between consecutive steps: from it on the second repeats the first; the rest is the least stiffness, of the
# model's, that such a secant shows
SAME_DIRECTION = 0.95

# share of the slope: steps that fall by less are shortened. Above PETSc's 1e-4; with 0.1 there are as many iterations
LEAST_DECREASE = 0.02
HALVINGS = 6  # of a step that is shortened, without a unit: it ends within 1/64 of its length of the minimum on it

# fraction of the terms whose difference the energy is: a smaller decrease is round-off
CANCELLATION = 2e-15

# iterations, without a unit: so many in a row without a step, or of short steps that leave forces as they are, show
# that the next one will not go on either
STALL = 10

BALANCED = 1e-2  # of the largest force on a body: what may be left of the gradient; a linear solve leaves about as much
SHORT = 5.0  # times the tolerance: shorter steps take the last matrix
CONTRACTING = 0.5  # ratio of consecutive step lengths: up to it they approach the minimum


@dataclass(eq=False)
class Iteration:
    """One Newton iteration.

    Attributes
    ----------
    energy : the potential at the start [kg m^2]
    direction : (n_owned, d) [m]
        Newton's full step.
    slope : derivative of the potential along it [kg m^2]
    speed : largest row of the direction over the step's length in time [m/s]
    projection : of the Hessian: "clamp" (negative eigenvalues cut off), "abs" (by size) or "none"
    matrix_age : iterations since the matrix was assembled
    at_rounding : whether the decrease cannot be distinguished from round-off
    lengthening : factor of the direction that was tried; 1 but for steps that repeat the last one
    cap : share of the direction, at most 1, with which the line search begins
    backtracks : by the line search
    by_model : whether the line search accepts that share unseen, as the decrease over it is round-off
    meets : whether the direction was found with pairs that are predicted to meet
    as_promised : whether the potential fell by about what its model promised, and the step was not lengthened, so that
        its matrix may serve again
    """

    start: Positions
    energy: float
    direction: np.ndarray
    slope: float
    speed: float
    projection: str
    matrix_age: int
    at_rounding: bool
    lengthening: float
    cap: float
    backtracks: int = 0
    by_model: bool = False
    meets: bool = False
    as_promised: bool = False

    @property
    def full(self) -> bool:
        """Whether the whole direction was taken."""
        return self.cap == 1.0 and self.backtracks == 0 and not self.meets


_serial = count()


@dataclass
class Solve:
    """The state of one minimisation.

    Attributes
    ----------
    states : the last two configurations, so that terms share what they derived from them (`Positions.get`)
    vectors : by the handle of a vector of PETSc, the number of changes to it, and its configuration then
    tolerance : [m/s], the relative one of the present state included
    projection : of the next Hessian
    unprojected_failed : whether the last unprojected Hessian was indefinite, or its direction led nowhere: the next one
        is projected instead
    gradient : (n_owned, d), zero in fixed rows
    last, before : the last two iterations
    matrix_age : iterations since the matrix was assembled; None where the next iteration needs a new one
    trials : evaluations of the potential by the line search
    meets : whether the present direction was found with pairs that are predicted to meet
    stalled : iterations in a row that have gained nothing
    stalls : how often so many had that a remedy was taken
    balancing : iterations that were made only because forces did not balance yet
    serial : its number in this process
    """

    states: list[Positions]
    tolerance: float
    gradient: np.ndarray
    vectors: dict[int, tuple[int, Positions]] = field(default_factory=dict)
    report: NewtonReport = field(default_factory=NewtonReport)
    projection: str = "clamp"
    unprojected_failed: bool = False
    last: Iteration | None = None
    before: Iteration | None = None
    matrix_age: int | None = None
    trials: int = 0
    meets: bool = False
    stalled: int = 0
    stalls: int = 0
    balancing: int = 0
    serial: int = field(default_factory=_serial.__next__)


# ---- rules


def next_projection(kept: float, full: bool, detects_indefinite: bool) -> str:
    """The projection of the Hessian after a step.

    Parameters
    ----------
    kept : the actual decrease of the potential over the one that the model promised
    full : whether the step was taken in full
    detects_indefinite : whether the linear solver would notice an indefinite matrix
    """
    if kept > TOO_STIFF and full and detects_indefinite:
        return "none"
    return "abs" if kept < TRUSTED else "clamp"


def is_at_rounding(slope: float, scale: float) -> bool:
    """Whether a decrease like the slope is round-off of an energy whose cancelling parts have the size `scale`."""
    return abs(slope) <= CANCELLATION * scale


def falling_share(slope_at: Callable[[float], float]) -> float:
    """Share of a step up to which the potential falls, by its slopes along it; the least share where it rises. PETSc's
    cubic model would leave a tenth of a step into a barrier. Where second derivatives jump, as where the closest point
    of a contact leaves a triangle, models of both sides lead back and forth, and full steps gain next to nothing.
    """
    low, high = 0.0, 1.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if slope_at(middle) < 0.0 else (low, middle)
    return low or high


def gains_nothing(last: Iteration, before: Iteration | None) -> bool:
    """Whether the last step was cut to next to nothing, and the one before had led no nearer to the minimum."""
    return last.cap < LEAST_DECREASE**2 and last.speed > CONTRACTING * speed_of(before)


def keeps_matrix(last: Iteration | None, before: Iteration | None, tolerance: float) -> bool:
    """Whether the last matrix serves for another step: near the minimum, and repeatedly only while steps contract."""
    if last is None or last.at_rounding or not (last.full and last.as_promised) or last.speed > SHORT * tolerance:
        return False
    return last.matrix_age == 0 or last.speed <= CONTRACTING * speed_of(before)


def stops(last: Iteration, before: Iteration | None, tolerance: float) -> str:
    """Why the solve ends: "TOLERANCE", "ROUNDING" (the energy cannot fall further in double precision), or empty."""
    contracts = last.speed <= CONTRACTING * speed_of(before)
    if last.speed <= tolerance and (last.at_rounding or last.full):
        return "TOLERANCE"
    if last.at_rounding and not contracts:
        return "ROUNDING"
    return ""


def step_factor(start: Positions, direction: np.ndarray, projection: str, last: Iteration | None, total: Sum) -> float:
    """Factor of a new direction: above 1 where it repeats the last one, and the potential is softer than its model."""
    if last is None or last.meets or "none" in (last.projection, projection):
        return 1.0
    return lengthening(direction, last.direction, start.owned - last.start.owned, total)


def speed_of(iteration: Iteration | None) -> float:
    """Its speed [m/s]; inf before the first one."""
    return np.inf if iteration is None else iteration.speed


def fraction_kept(last: Iteration, end: Positions, energy: float, total: Sum) -> float:
    """The actual decrease of the potential, whose value at the step's `end` is `energy` [kg m^2], over the one that the
    quadratic model promised for the part of the direction that was taken. Collective.
    """
    taken, direction = end.owned - last.start.owned, last.direction
    along, size = total(np.array([np.vdot(taken, direction), np.vdot(direction, direction)]))
    part = along / max(size, 1e-300)
    promised = last.slope * part * (1.0 - 0.5 * part)
    return (energy - last.energy) / min(promised, -1e-300)


def lengthening(direction: np.ndarray, last: np.ndarray, moved: np.ndarray, total: Sum) -> float:
    """Factor of a step whose direction repeats the `last` one, along which positions were `moved`, both by projected
    Hessians; 1 for other steps. Arrays are (n_owned, d).
    """
    pairs = ((direction, last), (direction, direction), (last, last), (moved, last))
    along, size, before, length = total(np.array([np.vdot(*pair) for pair in pairs]))
    if length <= 0.0 or along < SAME_DIRECTION * np.sqrt(size * before):
        return 1.0
    stiffness = (before - along) / length  # over that of the model
    return 1.0 if stiffness > TRUSTED else float(1.0 / max(stiffness, 1.0 - SAME_DIRECTION))
