"""What all lagged, smoothed Coulomb friction has in common (Li et al. 2020, section 5), and the prediction of which
contacts will stick.

The force of a contact that slides is constant along its slip. So Newton's model has no stiffness there, its direction
turns the slip round where the contact should stick, and the line search cuts the step off: again and again, once for
each contact that sticks. The energy of friction is convex and depends on slips alone, so the minimum of the model with
friction as it is, not its Taylor series, can be approached by a few linear solves in place of Newton iterations.
Between two of them the contacts' states are predicted from the last direction:

| a contact that | at the end of the direction | is predicted to |
|---|---|---|
| slides | has turned round, or slips less than eps | stick: its force is that of small slips, 2 / eps times the slip |
| was predicted to stick | slips more than eps | slide along that slip, with the full force |
| was predicted to slide | has turned round, or slips less than eps / 2 | stick |

This is a primal-dual active set method (Hintermueller, Ito and Kunisch 2003) for the friction of one Newton direction.
Energy and gradient are not changed by a prediction.
"""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact import friction_law
from pdvol.potentials.potential import Positions, Term

AS_IT_IS, STICKS, SLIDES = range(3)
# of eps: a contact predicted to slide sticks below this slip; between it and 1 the prediction stays as it is
LEAST_SLIDE = 0.5


@dataclass(frozen=True)
class Prediction:
    """The states of k contacts at the end of a Newton direction.

    Attributes
    ----------
    states : (k,) int
        AS_IT_IS, STICKS or SLIDES.
    ways : (k, d)
        Unit vectors along the slip, of contacts predicted to slide.
    sizes : (k,) slip [m] at the end, of the same contacts
    """

    states: np.ndarray
    ways: np.ndarray
    sizes: np.ndarray


class LaggedFriction(Term):
    """Friction on contacts whose normal forces, normals and closest points are those of the last `update_lag`.

    Slips [m] are measured from the start of the step, relative to moving obstacles. Friction is smoothed below a slip
    of eps_v times the step's length.

    Attributes
    ----------
    forces : (k,) friction force of each contact when it slides [N]
    normals : (k, d)
    """

    name = "friction"
    forces: np.ndarray
    normals: np.ndarray
    _eps: float
    _predicted: Prediction | None = None

    @abstractmethod
    def slips(self, x: Positions) -> np.ndarray:
        """(k, d) slips [m] in the contacts' tangential planes."""

    @abstractmethod
    def _rows(self, forces: np.ndarray) -> np.ndarray:
        """(n_owned, d) rows of the level from forces (k, d) of the contacts."""

    @abstractmethod
    def _add_tensors(self, tensors: np.ndarray, into: HessianBlocks) -> None:
        """Adds stiffness (k, d, d) [kg] against the contacts' slips."""

    @property
    def has_friction(self) -> bool:
        return len(self.forces) > 0

    def gradient(self, x: Positions) -> np.ndarray:
        if not self.has_friction:
            return np.zeros_like(x.owned)
        slips = self.slips(x)
        return self._rows(self.forces[:, None] * self._directions(slips))

    def _directions(self, slips: np.ndarray) -> np.ndarray:
        """(k, d) friction force over `forces`."""
        return friction_law.f1_over(_lengths(slips), self._eps)[:, None] * slips

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not self.has_friction:
            return
        slips, eps, normals = self.slips(x).copy(), self._eps, self.normals
        sizes = _lengths(slips)
        across, along = friction_law.f1_over(sizes, eps), friction_law.f1_slope(sizes, eps)
        if self._predicted is not None:
            sticks, slides = (self._predicted.states == state for state in (STICKS, SLIDES))
            across[sticks] = along[sticks] = 2.0 / eps
            across[slides], along[slides] = 1.0 / np.maximum(self._predicted.sizes[slides], eps), 0.0
            slips[slides] = self._predicted.ways[slides]
            sizes = _lengths(slips)
        forces = weight * np.maximum(self.forces, 0.0)  # those of unions may be negative
        ways = slips / np.maximum(sizes, 1e-300)[:, None]
        tensors = np.eye(normals.shape[1]) - normals[:, :, None] * normals[:, None, :]
        tensors *= (forces * across)[:, None, None]
        tensors += (forces * (along - across))[:, None, None] * ways[:, :, None] * ways[:, None, :]
        self._add_tensors(tensors, into)

    # ---- the prediction

    def predict(self, x: Positions, end: Positions) -> bool:
        """Predicts the contacts' states at the `end` of a direction from x, with the last prediction in mind. Returns
        whether any of this rank's differs from it. Collective.
        """
        if not self.has_friction:
            return False
        now, then, eps = self.slips(x), self.slips(end), self._eps
        sizes = _lengths(then)
        last = self._predicted or Prediction(np.zeros(len(now), dtype=int), np.zeros_like(now), np.zeros(len(now)))
        turned = lambda slips: np.einsum("kd,kd->k", slips, then) < 0.0
        sticks = (last.states == AS_IT_IS) & (_lengths(now) >= eps) & (turned(now) | (sizes < eps))
        sticks |= (last.states == SLIDES) & (turned(last.ways) | (sizes < LEAST_SLIDE * eps))
        slides = (last.states == STICKS) & (sizes > eps)
        pushed = self.forces > 0.0
        sticks, slides = sticks & pushed, slides & pushed
        if not (sticks.any() or slides.any()):
            return False
        states = np.where(sticks, STICKS, np.where(slides, SLIDES, last.states))
        ways = np.where(slides[:, None], then / np.maximum(sizes, eps)[:, None], last.ways)
        self._predicted = Prediction(states, ways, np.where(slides, sizes, last.sizes))
        return True

    def forget_prediction(self) -> None:
        """Contacts are in their present states again."""
        self._predicted = None

    def predicted_change(self, x: Positions) -> np.ndarray:
        """(n_owned, d) gradient at x [N] of the energy with the predicted states, less the gradient as it is."""
        if self._predicted is None:
            return np.zeros_like(x.owned)
        slips, ways, states = self.slips(x), self._predicted.ways, self._predicted.states
        across = 1.0 / np.maximum(self._predicted.sizes, self._eps)
        sliding = ways + across[:, None] * (slips - np.einsum("kd,kd->k", slips, ways)[:, None] * ways)
        found = np.where((states == STICKS)[:, None], (2.0 / self._eps) * slips, sliding)
        change = np.where((states == AS_IT_IS)[:, None], 0.0, found - self._directions(slips))
        return self._rows(self.forces[:, None] * change)


def _lengths(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)
