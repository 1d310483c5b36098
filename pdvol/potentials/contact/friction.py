"""Lagged, smoothed Coulomb friction between surfaces (Li et al. 2020, section 5), on the contacts that the barrier
finds.
"""

from dataclasses import replace

import numpy as np

from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact import barrier_law
from pdvol.potentials.contact import friction_law as smooth_friction
from pdvol.potentials.contact.barrier import SurfaceBarrier
from pdvol.potentials.potential import Positions, Term


class SurfaceFriction(Term):
    """Friction on all pairs that were active in the barrier at the last `update_lag`.

    Normal forces, normals and closest points are those of the last `update_lag`. Slip [m] is measured from the start of
    the step, relative to moving obstacles, so friction is smoothed below a slip of eps_v times the step's length.

    Parameters
    ----------
    barrier : SurfaceBarrier
    mu : coefficient of friction, or a symmetric matrix (objects, objects) of them between the surface's objects
    eps_v : sliding speed [m/s] below which friction is smoothed
    """

    name = "friction"

    def __init__(self, barrier: SurfaceBarrier, mu: float | np.ndarray, eps_v: float):
        self.barrier, self.surface, self.space = barrier, barrier.surface, barrier.space
        self.mu, self.eps_v = mu, eps_v
        self._at: np.ndarray | None = None  # positions of the surface where the next was found
        self._slipped: tuple[np.ndarray, np.ndarray]

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
        self._stencils = replace(stencils, weights=mu * pressures * stencils.weights)  # [N]
        self._normals = stencils.gaps / np.maximum(distances, 1e-300)[:, None]
        self._count, self._at = len(stencils.weights), None

    @property
    def has_friction(self) -> bool:
        return self._count > 0

    def _slip(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        """Slips (k, d) [m] in the pairs' tangential planes, and their lengths (k,)."""
        vertices = self.surface.vertices(x)
        if self._at is not vertices:
            u = self._stencils.gaps_of(vertices - self._start)
            u -= np.einsum("kd,kd->k", u, self._normals)[:, None] * self._normals
            self._slipped, self._at = (u, np.linalg.norm(u, axis=1)), vertices
        return self._slipped

    def value(self, x: Positions) -> float:
        if not self._count:
            return 0.0
        _, size = self._slip(x)
        return float(self._stencils.weights @ smooth_friction.f0(size, self._eps))

    def gradient(self, x: Positions) -> np.ndarray:
        if not self._count:
            return np.zeros_like(x.owned)
        slip, size = self._slip(x)
        forces = (self._stencils.weights * smooth_friction.f1_over(size, self._eps))[:, None] * slip
        return self.surface.rows_of(self._stencils.scatter(forces, len(self._start)))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not self._count:
            return
        slip, size = self._slip(x)
        n, along = self._normals, slip / np.maximum(size, 1e-300)[:, None]
        across, slope = smooth_friction.stiffness(size, self._eps, majorise=into.projection == "abs")
        forces = weight * np.maximum(self._stencils.weights, 0.0)  # those of unions may be negative
        tensors = np.eye(n.shape[1]) - n[:, :, None] * n[:, None, :]
        tensors *= (forces * across)[:, None, None]
        tensors += (forces * (slope - across))[:, None, None] * along[:, :, None] * along[:, None, :]
        self.surface.add_tensors(self._stencils, tensors, into)
