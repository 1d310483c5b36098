"""The contact barrier between surfaces: the sum over contacts of their weight times the law of `barrier_law.py`.

Its contacts, their weights and their Hessians are those of docs/contact.md, "What is summed over". Energy and gradient
are exact, and so is the Hessian that is not projected; projected ones leave out what is negative.

Source: Li et al. 2020 (Incremental Potential Contact); Li et al. 2023 (convergent IPC).
"""

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.levels.obstacles import Obstacle
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.collision_surface import CollisionSurface
from pdvol.potentials.contact.meeting import different_pairs
from pdvol.potentials.contact.native import library
from pdvol.potentials.contact.stencils import Stencils
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions, Term


class SurfaceBarrier(Term):
    """Barrier between all boundary primitives nearer than dhat, obstacles included.

    Parameters
    ----------
    surface : CollisionSurface
    kappa : stiffness [Pa]
    """

    name = "barrier"

    def __init__(self, surface: CollisionSurface, kappa: float):
        self.surface, self.space, self.dhat, self.kappa = surface, surface.space, surface.dhat, kappa
        self._at: Positions | None = None  # where the next was found
        self._stencils: Stencils
        self._summed: tuple[Stencils | None, float, float, np.ndarray] = None, 0.0, 0.0, np.zeros((0, 0))

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The rigid surfaces."""
        return self.surface.obstacles

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.move_obstacles(t0)

    def move_obstacles(self, time: float) -> None:
        if self.surface.move_obstacles(time):
            self._at = None

    def stencils(self, x: Positions) -> Stencils:
        """The contacts at x that touch this rank's vertices, found once per x. Collective."""
        if self._at is not x:
            self._stencils, self._at = self.surface.contacts(self.surface.vertices(x)), x
        return self._stencils

    def _sum(self, x: Positions) -> tuple[float, np.ndarray]:
        """The energy [J] of this rank's share, and its gradient (n, d) [N] by the surface's vertices: once for each
        state and stiffness.
        """
        found = self.stencils(x)
        if self._summed[0] is not found or self._summed[1] != self.kappa:
            gradient = np.zeros((len(self.surface.objects), self.space.dim))
            energy = library().barrier_sum(self.space.dim, found.c, self.dhat, self.kappa, pointer(gradient))
            self._summed = found, self.kappa, energy, gradient
        return self._summed[2:]

    def value(self, x: Positions) -> float:
        return reduce(self.space.comm, self._sum(x)[0] if len(self.stencils(x)) else 0.0)

    def gradient(self, x: Positions) -> np.ndarray:
        return self.surface.rows_of(self._sum(x)[1]) if len(self.stencils(x)) else np.zeros_like(x.owned)

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        found = self.stencils(x)
        if len(found):
            law = self.dhat, self.kappa, weight, into.projection != "none"
            self.surface.add_blocks(library().barrier_blocks, into, found, pointer(self.surface.vertices(x)), *law)

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = MIN_GAP_SHARE
    ) -> float:
        return self.surface.max_step(
            self.surface.vertices(x), self.surface.vertices(x.moved(1.0, direction), at=until), gap_share
        )

    def closing(self, x: Positions, path: np.ndarray, until: float) -> set[tuple[int, int]]:
        """Pairs of objects whose gap vectors, closest points held, would be gone or turned round at the path's end."""
        found = self.stencils(x)
        ends = found.gaps_of(self.surface.vertices(x.moved(1.0, path), at=until))
        meet = np.einsum("kd,kd->k", ends, found.gaps) <= 0.0
        one, other = (objects[meet] for objects in found.objects_in_contact(self.surface.objects))
        return different_pairs(one, other, self.space.comm)

    def count(self, x: Positions) -> int:
        """Number of contacts at x. Collective."""
        return reduce(self.space.comm, int(np.count_nonzero(self.stencils(x).counted)))

    def min_gap(self, x: Positions) -> float:
        """Smallest distance [m] among the contacts; inf when there are none. Collective."""
        nearest = float(np.linalg.norm(self.stencils(x).gaps, axis=1).min(initial=np.inf))
        return reduce(self.space.comm, nearest, MPI.MIN)
