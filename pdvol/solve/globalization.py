"""Globalization of Newton's method: the projection of the Hessian, and the lengthening of repeated steps.

The next projection follows from how well the last model promised the decrease (in the spirit of Chen et al. 2024):

| the model promised | the next Hessian |
|---|---|
| about the actual decrease | negative eigenvalues of local Hessians cut off: the nearest positive one |
| much more | negative eigenvalues by size, which overshoots less |
| much less | unprojected, since cutting off made it too stiff; projected for a while if indefinite |

Where the Hessian is indefinite every projected one is too stiff: step after step has the same direction, each a few per
cent shorter than the last. The second of them shows the stiffness in that direction, and so the length of the whole
series (a secant).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

Sum = Callable[[np.ndarray], np.ndarray]
"""Sums an array over all ranks."""

TRUSTED = 0.5  # share of the promised decrease: a model that delivers less overshoots
TOO_STIFF = 1.25  # times the promised decrease: a model that delivers more is too stiff
PAUSE = 2  # iterations without an unprojected Hessian after a bad one; doubled each time, so that few are tried

SAME_DIRECTION = 0.95  # cosine between consecutive steps from which on the second repeats the first
SOFT = 0.5  # of the model's stiffness in that direction: a softer potential gets a longer step
MAX_LENGTHENING = 20.0  # factor: the secant is unbounded where the stiffness vanishes


@dataclass(frozen=True)
class Projection:
    """How the Hessian is made positive definite, and what the next choice depends on.

    Attributes
    ----------
    mode : "clamp" (negative eigenvalues cut off), "abs" (by size) or "none"
    steps : taken so far in this solve
    unprojected_from : steps before which "none" is not chosen
    pause : iterations
    """

    mode: str = "clamp"
    steps: int = 0
    unprojected_from: int = 0
    pause: int = PAUSE

    def after(self, promised: float, decrease: float, full: bool, detects_indefinite: bool) -> "Projection":
        """The projection after a step.

        Parameters
        ----------
        promised, decrease : change of the potential by the model and the actual one; negative where the potential
            decreases
        full : whether the step was taken in full
        detects_indefinite : whether the linear solver would notice an indefinite matrix
        """
        kept = decrease / min(promised, -1e-300)
        last = replace(self, steps=self.steps + 1)
        if kept < TRUSTED:
            last = last.after_indefinite()
        unprojected = kept > TOO_STIFF and full and detects_indefinite and last.steps >= last.unprojected_from
        return replace(
            last,
            mode="none" if unprojected else "abs" if kept < TRUSTED else "clamp",
        )

    def after_rounding(self) -> "Projection":
        """The projection after a step whose decrease cannot be distinguished from round-off."""
        return replace(self, steps=self.steps + 1, mode="clamp")

    def after_indefinite(self) -> "Projection":
        """The projection after an unprojected Hessian failed; the same one where it was projected."""
        if self.mode != "none":
            return self
        pause = 2 * self.pause
        return replace(self, mode="clamp", pause=pause, unprojected_from=self.steps + pause)

    def strongest(self) -> "Projection":
        """The safest projection; the same one where it is in use."""
        return self if self.mode == "abs" else replace(self, mode="abs")


def promised_decrease(slope: float, taken: np.ndarray, direction: np.ndarray, total: Sum) -> float:
    """Change of the potential by the quadratic model for the step `taken`, a share of the direction (both (n_owned,
    d)).

    `slope` is the derivative along the direction.
    """
    along, size = total(np.array([np.vdot(taken, direction), np.vdot(direction, direction)]))
    share = along / max(size, 1e-300)
    return slope * share * (1.0 - 0.5 * share)


def lengthening(direction: np.ndarray, last: np.ndarray, moved: np.ndarray, total: Sum) -> float:
    """Factor of a step whose direction repeats the `last` one, along which positions were `moved`, both by projected
    Hessians; 1 for other steps. Arrays are (n_owned, d).
    """
    pairs = ((direction, last), (direction, direction), (last, last), (moved, last))
    along, size, before, length = total(np.array([np.vdot(*pair) for pair in pairs]))
    if length <= 0.0 or along < SAME_DIRECTION * np.sqrt(size * before):
        return 1.0
    stiffness = (before - along) / length  # over that of the model
    return 1.0 if stiffness > SOFT else float(1.0 / max(stiffness, 1.0 / MAX_LENGTHENING))
