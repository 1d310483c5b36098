"""Lagged, smoothed Coulomb friction between surfaces (Li et al. 2020, section 5), on the contacts that the barrier
finds.
"""

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact import barrier_law
from pdvol.potentials.contact.barrier import SurfaceBarrier
from pdvol.potentials.contact.lagged_friction import LaggedFriction
from pdvol.potentials.contact.native import library
from pdvol.potentials.potential import Positions


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
        distances = np.linalg.norm(stencils.gaps, axis=1)
        pressures = barrier_law.pressure(
            np.minimum(distances / self.barrier.dhat, 1.0) ** 2, self.barrier.dhat, self.barrier.kappa
        )
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
