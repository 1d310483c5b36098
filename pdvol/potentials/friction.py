"""Lagged, smoothed Coulomb friction between surfaces (Li et al. 2020, section 5), through ipctk."""

import ipctk
import numpy as np

from pdvol.potentials import smooth_friction
from pdvol.potentials.barrier import SurfaceBarrier
from pdvol.potentials.contact_candidates import share_of
from pdvol.potentials.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions, Term


class SurfaceFriction(Term):
    """Friction on all pairs that the barrier held apart at the last `lag`.

    Slip is measured from the start of the step, obstacles' own motion included, so the threshold is eps_v times the step's length.
    """

    name = "friction"

    def __init__(self, barrier: SurfaceBarrier, mu: float, eps_v: float):
        self.barrier, self.surface, self.space = barrier, barrier.surface, barrier.space
        self.mu, self.eps_v = mu, eps_v

    def begin_step(self, x_t: Positions, t0: float, t1: float) -> None:
        self._start = self.surface.vertices(x_t, at=t0)
        self._eps = self.eps_v * (t1 - t0)
        self._potential = ipctk.FrictionPotential(eps_v=self._eps)
        self.lag(x_t)

    def lag(self, x: Positions) -> None:
        active, vertices = self.barrier.collisions(x)
        self._lagged, self._stencils = ipctk.TangentialCollisions(), None
        if len(active):
            self._lagged.build(self.surface.mesh, vertices, active, self.barrier._potential, self.mu)
        self._mine = share_of(self._lagged, ipctk.TangentialCollisions(), "collisions", self.space.comm)

    @property
    def rubs(self) -> bool:
        return len(self._lagged) > 0

    def _slip(self, x: Positions) -> np.ndarray:
        return np.asfortranarray(self.surface.vertices(x) - self._start)

    def value(self, x: Positions) -> float:
        if not len(self._lagged):
            return 0.0
        return self.space.comm.allreduce(float(self._potential(self._mine, self.surface.mesh, self._slip(x))))

    def gradient(self, x: Positions) -> np.ndarray:
        if not len(self._lagged):
            return np.zeros_like(x.owned)
        return self.surface.rows_of_gradient(self._potential.gradient(self._mine, self.surface.mesh, self._slip(x)))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if not len(self._lagged):
            return
        if self._stencils is None:
            self._stencils, self._bases = self.surface.tangential_stencils(self._mine)
        slip = np.einsum("kdt,kd->kt", self._bases, self._stencils.gaps(self._slip(x)))
        size = np.linalg.norm(slip, axis=1)
        along = slip / np.maximum(size, 1e-300)[:, None]
        round_, slope = (k[:, None, None] for k in smooth_friction.stiffness(size, self._eps, majorise=into.positive == "abs"))
        middle = round_ * np.eye(slip.shape[1]) + (slope - round_) * along[:, :, None] * along[:, None, :]
        forces = self._stencils.weights
        if into.positive != "none":  # in 3D some pairs of the improved maximum weigh negatively
            forces = np.abs(forces) if into.positive == "abs" else np.maximum(forces, 0.0)
        self.surface.add_stencils(self._stencils, weight * forces[:, None, None] * (self._bases @ middle @ self._bases.transpose(0, 2, 1)), into)
