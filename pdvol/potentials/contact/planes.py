"""Contact and friction with half-spaces, exactly: only vertices can touch a plane first.

The law is that of the surface barrier (`barrier.py`): kappa a dhat g(s), g(s) = -(s - 1)^2 ln s, s = (gap / dhat)^2, a
the vertex's area at rest. A plane needs neither a broad phase nor gathered surfaces, may move, and its gap is linear in
x. ipctk's plane candidates are not used, because they miss contacts beyond dhat / 2 and have neither friction nor
motion.
"""

from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from pdvol.compiled import pointer
from pdvol.geometry.level_mesh import LevelMesh, facet_sizes
from pdvol.geometry.poses import Pose
from pdvol.levels.clocks import Clocks
from pdvol.levels.obstacles import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.parallel import reduce
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.lagged_friction import LaggedFriction
from pdvol.potentials.contact.meeting import different_pairs
from pdvol.potentials.contact.native import library
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions, Term


def boundary_areas(mesh: LevelMesh) -> np.ndarray:
    """(n,) each vertex's share of the boundary at rest [m^(d-1)], zero inside."""
    size = facet_sizes(mesh.points, mesh.boundary)
    return np.bincount(mesh.boundary.ravel(), np.repeat(size / mesh.dim, mesh.dim), minlength=len(mesh.points))


class _Contacts(NamedTuple):
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
    clocks : of the planes' motions

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
        clocks: Clocks | None = None,
    ):
        self.space, self.planes, self.dhat, self.kappa = space, planes, dhat, kappa
        self.clocks = Clocks() if clocks is None else clocks
        areas = boundary_areas(space.mesh)[space.owned_points]
        self.vertices = np.flatnonzero(areas > 0)
        self.areas = areas[self.vertices]
        self._sizes = space.dim, len(planes), len(self.vertices)
        self._room = (
            np.empty((2, len(planes) * len(self.vertices)), dtype=np.int64),
            np.empty(len(planes) * len(self.vertices)),
        )
        self._at: Positions | None = None  # where the next was found
        self._found: _Contacts
        self._law: tuple[_Contacts | None, float, float, np.ndarray, np.ndarray]
        self.move_obstacles(0.0)

    def poses_at(self, time: float) -> tuple[Pose, ...]:
        """The planes' poses at a time [s]."""
        return tuple(plane.pose(self.clocks.of(plane, time)) for plane in self.planes)

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

    def _contacts(self, x: Positions) -> "_Contacts":
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
            self._found = _Contacts(gaps, plane[:count].copy(), vertex[:count].copy(), near[:count].copy())
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
