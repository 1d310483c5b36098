"""Which stand-in for the Hessian Newton takes next, by what came of the last one's promise (in the spirit of Chen et
al. 2024).

| it promised | the next one |
|---|---|
| about what came | negative eigenvalues of local Hessians cut off: nearest to Newton's own among the positive ones |
| much more than came | taken by size, which overshoots less; and contacts without short cuts for the rest of the solve |
| much less than came | as it is: cutting off has made it too stiff. Should it be indefinite, the linear solve notices, and this is left for a while |

Where the Hessian is indefinite every stand-in is too stiff: step after step goes the same way, each a few per cent
shorter than the last. How much softer the truth is that way shows in the second of them, and so how far it is to the
end of the series (a secant).
"""

import numpy as np

TRUST = 0.5  # of the promised decrease: a model that delivers less is not trusted
STIFF = 1.25  # times it: a model that delivers more is too stiff
TINY_CAP, STUCK = 0.05, 3  # so many steps in a row cut so short by contact: the model does not see what stops it
# iterations until an unfiltered Hessian is tried again after one was indefinite or not to be trusted; doubled before
# each use
PAUSE = 2

REPEATS = 0.95  # cosine between steps from which on the second goes the first's way
SOFT = 0.5  # of the model's stiffness that way: where the truth has less, the step is lengthened
LONGEST = 20.0  # times


class ModelChoice:
    """The choice during one solve.

    Attributes
    ----------
    positive : "clamp", "abs" or "none", as `HessianBlocks` takes it
    quick : bool, as `HessianBlocks` takes it
    """

    def __init__(self):
        self.positive, self.quick = "clamp", True
        self._steps, self._raw_from, self._pause, self._stuck = 0, 0, PAUSE, 0

    def took(self, promised: float, came: float, whole: bool, cap: float, may_be_raw: bool) -> None:
        """After a step: the decrease promised for it and the one that came [both < 0 where all is well], whether it was
        taken in full, what contact and inversion allowed of it, and whether the linear solver would notice an
        indefinite matrix.
        """
        self._steps += 1
        kept = came / min(promised, -1e-300)
        if kept < TRUST:
            self.was_indefinite()  # or as good as that
        raw = kept > STIFF and whole and may_be_raw and self._steps >= self._raw_from
        self.positive = "none" if raw else "abs" if kept < TRUST else "clamp"
        self._stuck = self._stuck + 1 if cap < TINY_CAP else 0
        self.quick = self.quick and kept >= TRUST and self._stuck < STUCK

    def at_rounding(self) -> None:
        """After a step whose decrease cannot be told from round-off."""
        self._steps += 1
        self.positive = "clamp"

    def was_indefinite(self) -> bool:
        """After a linear solve or a line search failed: whether the Hessian was taken as it is, and will not be for
        some steps.
        """
        if self.positive != "none":
            return False
        self.positive = "clamp"
        self._pause *= 2
        self._raw_from = self._steps + self._pause
        return True

    def be_careful(self) -> bool:
        """After a line search failed: the safest model from here on; False where it was that already."""
        if self.positive == "abs" and not self.quick:
            return False
        self.positive, self.quick = "abs", False
        return True


def promised_decrease(slope: float, taken: np.ndarray, direction: np.ndarray, total) -> float:
    """What the quadratic model with this slope along the direction says of the step taken, a share of it; `total` sums
    over all ranks.
    """
    along, size = total(np.array([np.vdot(taken, direction), np.vdot(direction, direction)]))
    share = along / max(size, 1e-300)
    return slope * share * (1.0 - 0.5 * share)


def lengthening(direction: np.ndarray, last: np.ndarray, went: np.ndarray, total) -> float:
    """How many times as far to go along a direction that repeats the `last`, along which positions `went`, both from
    models that are positive.

    All (n_owned, d); `total` sums over all ranks.
    """
    pairs = ((direction, last), (direction, direction), (last, last), (went, last))
    along, size, before, length = total(np.array([np.vdot(*pair) for pair in pairs]))
    if length <= 0.0 or along < REPEATS * np.sqrt(size * before):
        return 1.0
    stiffness = (before - along) / length  # over that of the model
    return 1.0 if stiffness > SOFT else float(1.0 / max(stiffness, 1.0 / LONGEST))
