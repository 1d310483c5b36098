"""Lagged, smoothed Coulomb friction (Li et al. 2020, section 5), and the prediction of which contacts will stick.

The force of a contact that slides is constant along its slip. So Newton's model has no stiffness there, its direction
turns the slip round where the contact should stick, and the line search cuts the step off: again and again, once for
each contact that sticks. So a contact that slides, and at the end of the direction has turned round or slips less than
eps, is predicted to stick: its force is proportional to the slip, with the law's force over slip at that end, or with
that of small slips, 2 / eps, after a turn. (By the latter alone, what ends just below eps is held too hard, and its
direction goes too far by half of eps, again and again.) The direction is solved for again.
This is the first iteration of a primal-dual active set method (Hintermueller, Ito and Kunisch 2003) for the friction of
one Newton direction; further ones gain nothing. Energy and gradient are not changed by a prediction. The loops over
contacts are in native/friction.c.
"""

import numpy as np
from mpi4py import MPI

from pdvol.compiled import ffi, pointer
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.candidates import Contacts
from pdvol.potentials.potential import Positions, Rates, Term


class LaggedFriction(Term):
    """Friction on all contacts of the barrier at the last `update_lag`, whose normal forces, normals and closest points
    are those of then.

    Slips [m] are measured from the start of the step's rates (`Rates`), relative to moving obstacles. Friction is
    smoothed below a slip of eps_v times their duration. Normal forces and closest points are those at the step's start.

    Parameters
    ----------
    mu : coefficient of friction, or a symmetric matrix (objects, objects) of them between the surface's objects
    eps_v : sliding speed [m/s] below which friction is smoothed

    Attributes
    ----------
    contacts : k contacts
    forces : (k,) friction force of each contact when it slides [N]
    sticks : (k,) [1/m]
        Force over slip, per unit of sliding force, of contacts that slide and are predicted to stick; 0 of others.
    """

    name = "friction"

    def __init__(self, barrier: ContactBarrier, mu: float | np.ndarray, eps_v: float):
        self.barrier, self.surface, self.space = barrier, barrier.surface, barrier.space
        self.mu, self.eps_v = mu, eps_v
        self.contacts: Contacts
        self._version = 0  # of forces, starts and smoothing

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._at_start = self._start = self.surface.vertices(x_t, at=t0)
        self._eps = self.eps_v * (t1 - t0)
        self.update_lag(x_t)

    def set_rates(self, rates: Rates) -> None:
        self._start = rates.start(self._at_start, lambda e: self.surface.vertices(e.x, at=e.time, lags=e.lags))
        self._eps = self._c.eps = self.eps_v * rates.duration
        self._c.start = pointer(self._start)
        self._version += 1

    def update_lag(self, x: Positions) -> None:
        found, mu = self.barrier.contacts(x), self.mu
        if isinstance(mu, np.ndarray):
            mu = mu[found.objects_in_contact(self.surface.objects)]
        k = len(found)
        self.contacts, self.forces, self._version = found, mu * found.pressures * found.weights, self._version + 1
        self.sticks = np.zeros(k)
        self._c = ffi.new("friction_t *", {"eps": self._eps, "sticks": pointer(self.sticks)})
        self._c.start, self._c.forces = pointer(self._start), pointer(self.forces)
        self._acts = self.space.reduce(k > 0, MPI.LOR)

    def forget_lag(self) -> None:
        """No friction until the next `update_lag`."""
        self.forces[:], self._version, self._acts = 0.0, self._version + 1, False

    @property
    def has_friction(self) -> bool:
        return self._acts  # the same on every rank: its calls are collective

    def _sum(self, x: Positions, predicted: bool = False) -> tuple[float, np.ndarray]:
        """The energy [J] of this rank's contacts, and the gradient (n, d) [N] by the surface's vertices; or what the
        prediction adds to this.
        """
        vertices = self.surface.vertices(x)
        gradient = np.zeros(vertices.shape)
        of = self.contacts.c, self._c, pointer(vertices), predicted, pointer(gradient)
        return library[self.space.dim].friction_sum(*of), gradient

    def found_at(self, x: Positions) -> tuple[float, np.ndarray]:
        """The energy and its gradient (n, d) by the surface's vertices, found once for each state."""
        return x.get((self, "sum"), lambda: self._sum(x), (self._version, self.surface.version))

    def value(self, x: Positions) -> float:
        return self.space.reduce(self.found_at(x)[0]) if self.has_friction else 0.0

    def gradient(self, x: Positions) -> np.ndarray:
        return self.surface.rows_of(self.found_at(x)[1]) if self.has_friction else np.zeros_like(x.owned)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not self.has_friction:
            return
        given = self.contacts.c, self._c, pointer(self.surface.vertices(x)), weight, into.projection != "none"
        self.surface.add_blocks(into, "friction_blocks", len(self.contacts), *given)

    # ---- the prediction

    def predict(self, x: Positions, end: Positions) -> bool:
        """Predicts contacts that stick at the `end` of a direction from x; whether this rank has any. Collective."""
        if not self.has_friction:
            return False
        places = pointer(self.surface.vertices(x)), pointer(self.surface.vertices(end))
        return library[self.space.dim].friction_predict(self.contacts.c, self._c, *places) > 0

    def forget_prediction(self) -> None:
        """Contacts slide or stick as they do."""
        self.sticks[:] = 0.0

    def predicted_change(self, x: Positions) -> np.ndarray:
        """(n_owned, d) gradient at x [N] of the energy as predicted, less the gradient as it is."""
        return self.surface.rows_of(self._sum(x, predicted=True)[1])
