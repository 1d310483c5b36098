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
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.geometry.rigid_motions import Pose
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.barrier import HalfSpaceBarrier, SurfaceBarrier
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


class SurfaceFriction(LaggedFriction):
    """Friction on all pairs that were active in the barrier at the last `update_lag`.

    Parameters
    ----------
    barrier : SurfaceBarrier
    mu : coefficient of friction, or a symmetric matrix (objects, objects) of them between the surface's objects
    eps_v : sliding speed [m/s] below which friction is smoothed
    """

    def __init__(self, barrier: SurfaceBarrier, mu: float | np.ndarray, eps_v: float):
        self.barrier, self.surface, self.space = barrier, barrier.surface, barrier.space
        self.mu, self.eps_v = mu, eps_v
        self._at: np.ndarray | None = None  # positions of the surface where the next was found
        self._slips: np.ndarray

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._start = self.surface.vertices(x_t, at=t0)
        self._eps = self.eps_v * (t1 - t0)
        self.update_lag(x_t)

    def update_lag(self, x: Positions) -> None:
        stencils = self.barrier.stencils(x)
        distances, pressures = np.linalg.norm(stencils.gaps, axis=1), np.empty(len(stencils))
        law = self.barrier.dhat, self.barrier.kappa
        library().contact_pressures(self.space.dim, stencils.c, *law, pointer(pressures))
        mu = self.mu
        if isinstance(mu, np.ndarray):
            mu = mu[stencils.objects_in_contact(self.surface.objects)]
        self._stencils, self._at = stencils, None
        self.forces = mu * pressures * stencils.weights
        self._acts = reduce(self.space.comm, len(self.forces) > 0, MPI.LOR)
        self.normals = stencils.gaps / np.maximum(distances, 1e-300)[:, None]

    @property
    def has_friction(self) -> bool:
        return self._acts  # the same on every rank: slips are collective

    def slips(self, x: Positions) -> np.ndarray:
        vertices = self.surface.vertices(x)
        if self._at is not vertices:
            slips = np.empty_like(self.normals)
            given = pointer(self.normals), pointer(self._start), pointer(vertices)
            library().friction_slips(self.space.dim, self._stencils.c, *given, pointer(slips))
            self._slips, self._at = slips, vertices
        return self._slips

    def value(self, x: Positions) -> float:
        if not self.has_friction:
            return 0.0
        return reduce(self.space.comm, float((self.forces * self._stencils.counted) @ self._dissipation(x)))

    def _rows(self, forces: np.ndarray) -> np.ndarray:
        return self.surface.rows_of(self._stencils.scatter(forces, len(self._start)))

    def _add_tensors(self, tensors: np.ndarray, into: HessianBlocks) -> None:
        self.surface.add_tensors(self._stencils, tensors, into)


class HalfSpaceFriction(LaggedFriction):
    """Lagged friction on all planes of a scene.

    Parameters
    ----------
    mu : coefficient of friction, or one (planes, bodies) for each plane and body
    eps_v : sliding speed [m/s] below which friction is smoothed
    """

    def __init__(self, barrier: HalfSpaceBarrier, mu: float | np.ndarray, eps_v: float):
        self.space, self.barrier, self.eps_v = barrier.space, barrier, eps_v
        self._bodies = barrier.space.mesh.point_bodies[barrier.space.owned_points][barrier.vertices]
        self._at: tuple[Positions | None, tuple[Pose, ...]] = None, ()  # where the next was found
        self._slips: np.ndarray
        self._mu = np.broadcast_to(mu, (len(barrier.planes), int(barrier.space.mesh.point_bodies.max()) + 1))

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self._x_t = x_t.owned
        self._eps = self.eps_v * (t1 - t0)
        self._start = self.barrier.poses_at(t0)
        self.update_lag(x_t)

    def update_lag(self, x: Positions) -> None:
        plane, vertex, force = self.barrier.forces(x)
        self._at = None, ()
        self._plane, self._vertices = plane, self.barrier.vertices[vertex]
        self.normals = self.barrier.normals[plane]
        self.forces = self._mu[plane, self._bodies[vertex]] * force
        feet = x.owned[self._vertices] - self.barrier.gaps(x)[plane, vertex][:, None] * self.normals
        self._feet = feet.copy()  # the planes' points that are touched, at rest
        for i, pose in enumerate(self.barrier.poses):
            self._feet[plane == i] = (feet[plane == i] - pose.shift) @ pose.rotation

    def _ground(self) -> np.ndarray:
        """(k, d) [m]: how far the planes have moved the points that are touched, since the step's start."""
        ground = np.zeros_like(self._feet)
        for i, (start, now) in enumerate(zip(self._start, self.barrier.poses, strict=True)):
            on = self._plane == i
            ground[on] = self._feet[on] @ (now.rotation - start.rotation).T + (now.shift - start.shift)
        return ground

    def slips(self, x: Positions) -> np.ndarray:
        if self._at[0] is not x or self._at[1] is not self.barrier.poses:
            u = x.owned[self._vertices] - self._x_t[self._vertices] - self._ground()
            self._slips = u - np.sum(u * self.normals, axis=1)[:, None] * self.normals
            self._at = x, self.barrier.poses
        return self._slips

    def value(self, x: Positions) -> float:
        if not self.has_friction:
            return reduce(self.space.comm, 0.0)
        return reduce(self.space.comm, float(np.sum(self.forces * self._dissipation(x))))

    def _rows(self, forces: np.ndarray) -> np.ndarray:
        out = np.zeros((self.space.n_owned, self.space.dim))
        np.add.at(out, self._vertices, forces)
        return out

    def _add_tensors(self, tensors: np.ndarray, into: HessianBlocks) -> None:
        rows = self.space.first_block + self._vertices
        into.add_pairs(rows, rows, tensors)
