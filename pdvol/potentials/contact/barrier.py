"""The contact barrier: the sum over contacts of their weight times the law kappa dhat g(s), g(s) = -(s - 1)^2 ln s,
s = (gap / dhat)^2 (`native/law.h`).

Contacts between surfaces, their weights and their Hessians are those of docs/contact.md, "What is summed over". Energy
and gradient are exact, and so is the Hessian that is not projected; projected ones leave out what is negative.

Of half-spaces only vertices can touch one first; the weight is a vertex's area at rest. A plane needs neither a broad
phase nor gathered surfaces, may move, and its gap is linear in x.

Source: Li et al. 2020 (Incremental Potential Contact); Li et al. 2023 (convergent IPC).
"""

from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.geometry.level_mesh import boundary_areas
from pdvol.geometry.rigid_motions import Pose
from pdvol.levels.obstacles import Obstacle
from pdvol.levels.script import Script
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import Stencils
from pdvol.potentials.contact.collision_surface import CollisionSurface
from pdvol.potentials.contact.native import library
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions, Term


def different_pairs(one: np.ndarray, other: np.ndarray, comm: MPI.Comm) -> set[tuple[int, int]]:
    """The pairs of different numbers in two arrays (k,), of all ranks together. Collective."""
    mine = {(int(a), int(b)) for a, b in np.unique(np.stack([one, other]), axis=1).T if a != b}
    return set().union(*comm.allgather(mine))


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


class _PlaneContacts(NamedTuple):
    """Vertices and planes at one configuration.

    Attributes
    ----------
    gaps : (planes, vertices) distances [m]
    plane, vertex, near : (k,) of each contact within dhat: its plane, index into `vertices`, and distance [m]
    """

    gaps: np.ndarray
    plane: np.ndarray
    vertex: np.ndarray
    near: np.ndarray


class HalfSpaceBarrier(Term):
    """Barrier against all planes of a scene.

    Parameters
    ----------
    space : LevelSpace
    planes : planes, moving or not
    dhat : activation distance [m]
    kappa : stiffness [Pa]
    script : of the planes' motions

    Attributes
    ----------
    poses : of the planes where they are now
    """

    name = "barrier"

    def __init__(
        self,
        space: LevelSpace,
        planes: tuple[Obstacle, ...],
        dhat: float,
        kappa: float,
        script: Script | None = None,
    ):
        self.space, self.planes, self.dhat, self.kappa = space, planes, dhat, kappa
        self.script = Script() if script is None else script
        areas = boundary_areas(space.mesh)[space.owned_points]
        self.vertices = np.flatnonzero(areas > 0)
        self.areas = areas[self.vertices]
        self._sizes = space.dim, len(planes), len(self.vertices)
        self._room = (
            np.empty((2, len(planes) * len(self.vertices)), dtype=np.int64),
            np.empty(len(planes) * len(self.vertices)),
        )
        self._at: Positions | None = None  # where the next was found
        self._found: _PlaneContacts
        self._law: tuple[_PlaneContacts | None, float, float, np.ndarray, np.ndarray]
        self.move_obstacles(0.0)

    def poses_at(self, time: float) -> tuple[Pose, ...]:
        """The planes' poses at a time [s]."""
        return tuple(self.script.pose(plane, time) for plane in self.planes)

    def _planes_at(self, poses: tuple[Pose, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Normals (planes, d) of planes at some poses, and distances (planes,) [m] from the origin along them."""
        points, normals = zip(
            *(plane.plane_at(pose) for pose, plane in zip(poses, self.planes, strict=True)), strict=True
        )
        return np.array(normals), np.einsum("pi,pi->p", normals, points)

    def move_obstacles(self, time: float) -> None:
        self.poses = self.poses_at(time)
        self.normals, self._offsets = self._planes_at(self.poses)
        self._at, self._law = None, (None, 0.0, 0.0, np.empty(0), np.empty(0))

    def begin_step(self, x_t: Positions, t0: float, t1: float, x_hat: Positions | None = None) -> None:
        self.move_obstacles(t0)

    def _contacts(self, x: Positions) -> "_PlaneContacts":
        """The gaps and contacts at x, found once per x."""
        if x is not self._at:
            gaps, ((plane, vertex), near) = np.empty((len(self.planes), len(self.vertices))), self._room
            count = library().plane_contacts(
                *self._sizes,
                pointer(self.vertices, "int64_t"),
                pointer(x.owned),
                pointer(self.normals),
                pointer(self._offsets),
                self.dhat,
                pointer(gaps),
                pointer(plane, "int64_t"),
                pointer(vertex, "int64_t"),
                pointer(near),
            )
            self._at = x
            self._found = _PlaneContacts(gaps, plane[:count].copy(), vertex[:count].copy(), near[:count].copy())
        return self._found

    def _evaluated(self, x: Positions) -> tuple[float, np.ndarray, np.ndarray]:
        """The energy [J], and of each contact the normal force [N] and its stiffness [N/m]: once for each state and
        stiffness.
        """
        found = self._contacts(x)
        if self._law[0] is not found or self._law[1] != self.kappa:
            forces, curvatures = np.empty(len(found.near)), np.empty(len(found.near))
            energy = library().plane_law(
                len(forces),
                pointer(found.vertex, "int64_t"),
                pointer(found.near),
                pointer(self.areas),
                self.dhat,
                self.kappa,
                pointer(forces),
                pointer(curvatures),
            )
            self._law = found, self.kappa, energy, forces, curvatures
        return self._law[2:]

    def gaps(self, x: Positions) -> np.ndarray:
        """(planes, surface vertices) distances [m], negative behind a plane."""
        return self._contacts(x).gaps

    def value(self, x: Positions) -> float:
        return reduce(self.space.comm, self._evaluated(x)[0])

    def forces(self, x: Positions) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Plane, vertex (index into `vertices`) and normal force [N] of each contact within dhat, (k,) each."""
        found = self._contacts(x)
        return found.plane, found.vertex, self._evaluated(x)[1]

    def gradient(self, x: Positions) -> np.ndarray:
        plane, vertex, force = self.forces(x)
        out = np.zeros_like(x.owned)
        if len(force):
            np.add.at(out, self.vertices[vertex], -force[:, None] * self.normals[plane])
        return out

    def add_hessian(self, x: Positions, weight: float, into: HessianBlocks) -> None:
        found, (_, _, curvature) = self._contacts(x), self._evaluated(x)
        if len(curvature):
            n = self.normals[found.plane]
            blocks = (weight * curvature)[:, None, None] * n[:, :, None] * n[:, None, :]
            into.add_diagonal(self.vertices[found.vertex], blocks)

    def max_step(
        self, x: Positions, direction: np.ndarray, until: float | None = None, gap_share: float = MIN_GAP_SHARE
    ) -> float:
        # A plane's gaps are taken to close at a constant rate: exact for translations. For rotations Newton's next
        # iterate is checked again.
        normals, offsets = (self.normals, self._offsets) if until is None else self._planes_at(self.poses_at(until))
        return library().plane_step(
            *self._sizes,
            pointer(self.vertices, "int64_t"),
            pointer(x.owned),
            pointer(np.ascontiguousarray(direction)),
            pointer(normals),
            pointer(offsets),
            pointer(self.gaps(x)),
            gap_share,
        )

    @property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The planes."""
        return self.planes

    def closing(self, x: Positions, path: np.ndarray, until: float) -> set[tuple[int, int]]:
        """Bodies with vertices within dhat of a plane that would be behind it at the path's end."""
        bodies = self.space.mesh.point_bodies
        found, (normals, offsets) = self._contacts(x), self._planes_at(self.poses_at(until))
        ends = (x.owned + path)[self.vertices[found.vertex]]
        behind = np.einsum("ki,ki->k", normals[found.plane], ends) <= offsets[found.plane]
        plane, vertex = found.plane[behind], found.vertex[behind]
        body = bodies[self.space.owned_points[self.vertices[vertex]]]
        return different_pairs(body, int(bodies.max()) + 1 + plane, self.space.comm)

    def min_gap(self, x: Positions) -> float:
        """Smallest distance to any plane [m]; inf where there is no surface. Collective."""
        return reduce(self.space.comm, float(self.gaps(x).min(initial=np.inf)), MPI.MIN)

    def count(self, x: Positions) -> int:
        """Number of contacts within dhat, of all ranks. Collective."""
        return reduce(self.space.comm, len(self._contacts(x).near))
