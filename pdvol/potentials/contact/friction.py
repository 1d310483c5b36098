"""Lagged, smoothed Coulomb friction between surfaces (Li et al. 2020, section 5), on the pairs that the barrier finds
with ipctk.
"""

from dataclasses import replace

import numpy as np

from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact import barrier_law
from pdvol.potentials.contact import friction_law as smooth_friction
from pdvol.potentials.contact.barrier import SurfaceBarrier
from pdvol.potentials.potential import Positions, Term


class SurfaceFriction(Term):
    """Friction on all pairs that the barrier held apart at the last `lag`.

    Slip is measured from the start of the step, obstacles' own motion included, so the threshold is eps_v times the
    step's length.

    Parameters
    ----------
    mu : coefficient of friction, or a symmetric matrix of them between the surface's parties
    eps_v : sliding speed [m/s] below which friction is smoothed
    """

    name = "friction"

    def __init__(self, barrier: SurfaceBarrier, mu: float | np.ndarray, eps_v: float):
        self.barrier, self.surface, self.space = barrier, barrier.surface, barrier.space
        self.mu, self.eps_v = mu, eps_v

    def begin_step(self, x_t: Positions, t0: float, t1: float) -> None:
        self._start = self.surface.vertices(x_t, at=t0)
        self._eps = self.eps_v * (t1 - t0)
        self.lag(x_t)

    def lag(self, x: Positions) -> None:
        stencils, gaps = self.barrier.stencils(x)
        distances = np.linalg.norm(gaps, axis=1)
        pushes = barrier_law.pressure(
            np.minimum(distances / self.barrier.dhat, 1.0) ** 2, self.barrier.dhat, self.barrier.kappa
        )
        mu = self.mu[stencils.sides(self.surface.parties)] if np.ndim(self.mu) else self.mu
        self._stencils = replace(
            stencils, weights=mu * pushes * np.where(stencils.oblique, stencils.weights, 0.0)
        )  # [N]
        self._normals = gaps / np.maximum(distances, 1e-300)[:, None]
        self._count = len(stencils.weights)

    @property
    def rubs(self) -> bool:
        return self._count > 0

    def _slip(self, x: Positions) -> tuple[np.ndarray, np.ndarray]:
        """Slips (k, d) across the pairs' normals, and their sizes."""
        u = self._stencils.gaps(self.surface.vertices(x) - self._start)
        u -= np.einsum("kd,kd->k", u, self._normals)[:, None] * self._normals
        return u, np.linalg.norm(u, axis=1)

    def value(self, x: Positions) -> float:
        mine = 0.0
        if self._count:
            _, size = self._slip(x)
            mine = float(
                np.where(self._stencils.counted, self._stencils.weights, 0.0) @ smooth_friction.f0(size, self._eps)
            )
        return self.space.comm.allreduce(mine)

    def gradient(self, x: Positions) -> np.ndarray:
        if not self._count:
            return np.zeros_like(x.owned)
        slip, size = self._slip(x)
        forces = (self._stencils.weights * smooth_friction.f1_over(size, self._eps))[:, None] * slip
        return self.surface.rows_of(self._stencils.gather(forces, len(self._start)))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not self._count:
            return
        slip, size = self._slip(x)
        along = slip / np.maximum(size, 1e-300)[:, None]
        round_, slope = (
            k[:, None, None] for k in smooth_friction.stiffness(size, self._eps, majorise=into.positive == "abs")
        )
        n = self._normals
        middle = (
            round_ * (np.eye(n.shape[1]) - n[:, :, None] * n[:, None, :])
            + (slope - round_) * along[:, :, None] * along[:, None, :]
        )
        forces = self._stencils.weights
        if into.positive != "none":  # in 3D some pairs of the improved maximum weigh negatively
            forces = np.abs(forces) if into.positive == "abs" else np.maximum(forces, 0.0)
        self.surface.add_stencils(self._stencils, weight * forces[:, None, None] * middle, into)
