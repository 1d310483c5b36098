"""Lagged, smoothed Coulomb friction between surfaces (Li et al. 2020, section 5), through ipctk."""

import ipctk
import numpy as np

from pdvol.potentials.barrier import SurfaceBarrier
from pdvol.potentials.collision_surface import PROJECTIONS
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
        self._potential = ipctk.FrictionPotential(eps_v=self.eps_v * (t1 - t0))
        self.lag(x_t)

    def lag(self, x: Positions) -> None:
        active, vertices = self.barrier.collisions(x)
        self._lagged = ipctk.TangentialCollisions()
        if len(active):
            self._lagged.build(self.surface.mesh, vertices, active, self.barrier._potential, self.mu)

    @property
    def rubs(self) -> bool:
        return len(self._lagged) > 0

    def _slip(self, x: Positions) -> np.ndarray:
        return np.asfortranarray(self.surface.vertices(x) - self._start)

    def value(self, x: Positions) -> float:
        return float(self._potential(self._lagged, self.surface.mesh, self._slip(x))) if len(self._lagged) else 0.0

    def gradient(self, x: Positions) -> np.ndarray:
        if not len(self._lagged):
            return np.zeros_like(x.owned)
        return self.surface.rows_of_gradient(self._potential.gradient(self._lagged, self.surface.mesh, self._slip(x)))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        if len(self._lagged):
            hessian = self._potential.hessian(self._lagged, self.surface.mesh, self._slip(x), PROJECTIONS[into.positive])
            self.surface.add_hessian(hessian, weight, into)
