"""The contact barrier between surfaces: the sum over active pairs of their weight times the law of `barrier_law.py`.

In ipctk's convergent formulation weights are areas, with the improved maximum; in the original one each contact counts
as one. Energies, and Hessians where `HessianBlocks.gauss_newton` allows it, come from stencils; gradients, full
Hessians and the active pairs from ipctk.

Source: Li et al. 2020 (Incremental Potential Contact); Li et al. 2023 (convergent IPC).
"""

from dataclasses import replace

import ipctk
import numpy as np
from mpi4py import MPI

from pdvol.levels.obstacles import Obstacle
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact import barrier_law
from pdvol.potentials.contact.collision_surface import CollisionSurface
from pdvol.potentials.contact.meeting import different_pairs
from pdvol.potentials.contact.stencils import Stencils
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions, Term


class SurfaceBarrier(Term):
    """Barrier between all pairs of boundary primitives nearer than dhat, obstacles included.

    Parameters
    ----------
    surface : CollisionSurface
    dhat : activation distance [m]
    kappa : stiffness: [Pa] where contacts are weighted, [N] (per metre of depth in 2D) where each counts as one; it may
        be changed between solves
    weighted : whether contacts are weighted by area
    """

    name = "barrier"

    def __init__(self, surface: CollisionSurface, dhat: float, kappa: float, weighted: bool = True):
        self.surface, self.space, self.dhat, self.kappa, self.weighted = surface, surface.space, dhat, kappa, weighted
        self._at: Positions | None = None  # where the next three were computed
        self._active: ipctk.NormalCollisions
        self._vertices: np.ndarray
        self._stencils: tuple[Stencils, np.ndarray] | None = None

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The rigid surfaces."""
        return self.surface.obstacles

    @property
    def _area(self) -> float:
        """ipctk's weight of a unit area, or of one contact, in its mesh, which may be scaled down."""
        return self.surface.primitives.scale**2 if self.weighted else 1.0

    @property
    def _potential(self) -> ipctk.BarrierPotential:
        return ipctk.BarrierPotential(dhat=self.dhat, stiffness=self.kappa / self._area, use_physical_barrier=True)

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.move_obstacles(t0)
        self._at, start = None, self.surface.vertices(x_t)
        self.surface.begin(start)
        if x_hat is not None:
            self.surface.candidates.begin(start, self.surface.vertices(x_hat))

    def move_obstacles(self, time: float) -> None:
        if self.surface.move_obstacles(time):
            self._at = None

    def collisions(self, x: Positions) -> tuple[ipctk.NormalCollisions, np.ndarray]:
        """The active pairs with a vertex of this rank at x, and the collision mesh's positions (n, d); built once per
        x.
        """
        if self._at is not x:
            vertices = self.surface.vertices(x)
            active = ipctk.NormalCollisions()
            active.use_area_weighting = self.weighted
            kinds = ipctk.NormalCollisions.CollisionSetType
            active.collision_set_type = kinds.IMPROVED_MAX_APPROX if self.weighted else kinds.IPC
            pairs = self.surface.pairs(vertices)
            if not pairs.empty():
                active.build(candidates=pairs, mesh=self.surface.mesh, vertices=vertices, dhat=self.dhat)
            self._active, self._vertices, self._at, self._stencils = active, vertices, x, None
        return self._active, self._vertices

    def stencils(self, x: Positions) -> tuple[Stencils, np.ndarray]:
        """The active pairs as arrays, and their gap vectors (k, d) [m]; built once per x."""
        active, vertices = self.collisions(x)
        if self._stencils is None:
            stencils = self.surface.stencils(active, vertices)
            stencils = replace(stencils, weights=stencils.weights / self._area)
            self._stencils = stencils, stencils.gaps(vertices)
        return self._stencils

    def value(self, x: Positions) -> float:
        active, _ = self.collisions(x)
        mine = 0.0
        if len(active):
            stencils, gaps = self.stencils(x)
            s = np.minimum(np.einsum("kd,kd->k", gaps, gaps) / self.dhat**2, 1.0)
            weights = np.where(stencils.owned, stencils.weights, 0.0)
            mine = float(weights @ barrier_law.energy(s, self.dhat, self.kappa))
        return self.space.comm.allreduce(mine)

    def gradient(self, x: Positions) -> np.ndarray:
        active, vertices = self.collisions(x)
        if not len(active):
            return np.zeros_like(x.owned)
        return self.surface.rows_of(self._potential.gradient(active, self.surface.mesh, vertices))

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        """By stencils where `into.gauss_newton` allows it, which is several times faster than projecting each pair's 12
        x 12 Hessian.
        """
        active, vertices = self.collisions(x)
        if not len(active):
            return
        if into.projection == "none" or not into.gauss_newton:
            projection = (
                ipctk.PSDProjectionMethod.NONE if into.projection == "none" else ipctk.PSDProjectionMethod.CLAMP
            )
            hessian = self._potential.hessian(active, self.surface.mesh, vertices, project_hessian_to_psd=projection)
            self.surface.add_hessian(hessian, weight, into)
            return
        stencils, gaps = self.stencils(x)
        s = np.einsum("kd,kd->k", gaps, gaps) / self.dhat**2
        share = (
            weight
            * np.maximum(stencils.weights, 0.0)
            * barrier_law.curvature(s, self.dhat, self.kappa)
            / (s * self.dhat**2)
        )
        self.surface.add_stencils(stencils, share[:, None, None] * gaps[:, :, None] * gaps[:, None, :], into)

    def contact_stiffness(self, x: Positions, masses: np.ndarray, blocks: np.ndarray) -> np.ndarray:
        """(k,) semi-implicit stiffness [N/m] of the contacts that this rank owns (`stiffness.py`), from masses (m,)
        [kg] and diagonal blocks (m, d, d) [N/m] of the level's points, in the input's order. Obstacles have neither.
        """
        stencils, gaps = self.stencils(x)
        masses, blocks = self.surface.of_vertices(masses), self.surface.of_vertices(blocks)
        squares = stencils.coefficients**2
        distances = np.linalg.norm(gaps, axis=1)
        normals = gaps / distances[:, None]
        mass = np.einsum("ki,ki->k", squares, masses[stencils.vertices])
        stiffness = np.einsum("ki,ka,kiab,kb->k", squares, normals, blocks[stencils.vertices], normals)
        return ((mass / distances**2 + stiffness) / squares.sum(axis=1))[stencils.owned]

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = MIN_GAP_SHARE
    ) -> float:
        return self.surface.max_step(
            self.surface.vertices(x), self.surface.vertices(x.moved(1.0, direction), at=until), gap_share
        )

    def closing(self, x: Positions, path: np.ndarray, until: float) -> set[tuple[int, int]]:
        """Pairs of objects whose gap vectors, closest points held, would be gone or turned round at the path's end."""
        stencils, gaps = self.stencils(x)
        ends = stencils.gaps(self.surface.vertices(x.moved(1.0, path), at=until))
        meet = np.einsum("kd,kd->k", ends, gaps) <= 0.0
        one, other = (objects[meet] for objects in stencils.objects_in_contact(self.surface.objects))
        return different_pairs(one, other, self.space.comm)

    def count(self, x: Positions) -> int:
        """Number of active pairs at x, of all ranks. Collective."""
        active, _ = self.collisions(x)
        if self.space.comm.size == 1:
            return len(active)
        return self.space.comm.allreduce(int(np.count_nonzero(self.stencils(x)[0].owned)))

    def min_gap(self, x: Positions) -> float:
        """Smallest distance [m] among active pairs of all ranks; inf when there are none. Collective."""
        active, vertices = self.collisions(x)
        gap = float(np.sqrt(active.compute_minimum_distance(self.surface.mesh, vertices))) if len(active) else np.inf
        return self.space.comm.allreduce(gap, op=MPI.MIN)
