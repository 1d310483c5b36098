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
Energy and gradient are not changed by a prediction. The loops over contacts are in native/friction.c.
"""

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from pdvol.compiled import pointer
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.native import ffi, library
from pdvol.potentials.potential import Positions, Term

AS_IT_IS, STICKS, SLIDES = range(3)  # as in native/friction.c


@dataclass(frozen=True)
class Prediction:
    """The states of k contacts at the end of a Newton direction.

    Attributes
    ----------
    states : (k,) int8
        AS_IT_IS, STICKS or SLIDES.
    ways : (k, d)
        Unit vectors along the slip, of contacts predicted to slide.
    sizes : (k,) slip [m] at the end, of the same contacts
    """

    states: np.ndarray
    ways: np.ndarray
    sizes: np.ndarray

    @property
    def pointers(self) -> tuple:
        """The three for C."""
        return pointer(self.states, "int8_t"), pointer(self.ways), pointer(self.sizes)


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
    space: LevelSpace
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

    def _dissipation(self, x: Positions) -> np.ndarray:
        """(k,) energy per unit of `forces` [m]."""
        energies, slips = np.empty(len(self.forces)), self.slips(x)
        library().friction_energies(self.space.dim, len(energies), pointer(slips), self._eps, pointer(energies))
        return energies

    def gradient(self, x: Positions) -> np.ndarray:
        return self._gradient(x, (ffi.NULL,) * 3) if self.has_friction else np.zeros_like(x.owned)

    def _gradient(self, x: Positions, predicted: tuple) -> np.ndarray:
        """(n_owned, d) [N], or what the predicted states add to it."""
        slips = self.slips(x)
        found = np.empty_like(slips)
        given = pointer(slips), pointer(self.forces), self._eps, *predicted
        library().friction_forces(self.space.dim, len(slips), *given, pointer(found))
        return self._rows(found)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not self.has_friction:
            return
        slips, d = self.slips(x), self.space.dim
        predicted = (ffi.NULL,) * 3 if self._predicted is None else self._predicted.pointers
        tensors = np.empty((len(slips), d, d))
        given = pointer(slips), pointer(self.normals), pointer(self.forces), self._eps
        law = weight, into.projection != "none", *predicted
        library().friction_tensors(d, len(slips), *given, *law, pointer(tensors))
        self._add_tensors(tensors, into)

    # ---- the prediction

    def predict(self, x: Positions, end: Positions) -> bool:
        """Predicts the contacts' states at the `end` of a direction from x, with the last prediction in mind. Returns
        whether any of this rank's differs from it. Collective.
        """
        if not self.has_friction:
            return False
        now, then = self.slips(x), self.slips(end)
        k, d = now.shape
        last = self._predicted or Prediction(np.zeros(k, dtype=np.int8), np.zeros((k, d)), np.zeros(k))
        given = pointer(now), pointer(then), pointer(self.forces), self._eps
        changed = library().friction_predict(d, k, *given, *last.pointers) > 0
        self._predicted = last if changed else self._predicted
        return changed

    def forget_prediction(self) -> None:
        """Contacts are in their present states again."""
        self._predicted = None

    def predicted_change(self, x: Positions) -> np.ndarray:
        """(n_owned, d) gradient at x [N] of the energy with the predicted states, less the gradient as it is."""
        return np.zeros_like(x.owned) if self._predicted is None else self._gradient(x, self._predicted.pointers)
