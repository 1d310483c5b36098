"""The collision geometry of one level: all bodies' boundaries and the rigid obstacles, in one ipctk mesh.

Bodies come first, in the order of `surface` (input indices of boundary vertices), obstacles behind them. Every rank
holds all of it, so contact does not depend on how the level is distributed.
"""

from dataclasses import replace

import ipctk
import numpy as np
from scipy.sparse import csr_array

from pdvol.levels.obstacles import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import ContactCandidates
from pdvol.potentials.contact.collision_mesh import CollisionMesh
from pdvol.potentials.contact.stencils import Stencils, normal_stencils
from pdvol.potentials.potential import KEPT, Positions

NARROW = {
    "additive": lambda keep: ipctk.AdditiveCCD(max_iterations=10_000, conservative_rescaling=1.0 - keep),
    "tight-inclusion": lambda keep: ipctk.TightInclusionCCD(tolerance=1e-6, max_iterations=1_000_000),
}
"""Continuous collision detection by name: how far a straight move may go.

Both stop where they cannot tell. The additive one leaves a share of each gap by itself.
"""

ipctk.set_num_threads(1)  # sums over contacts repeat to the last bit; measured again where speed asks for it


class CollisionSurface:
    """Boundaries of a level with its obstacles.

    Attributes
    ----------
    surface : (k,) int64
        Input indices of the bodies' boundary vertices, this rank's first.
    primitives : CollisionMesh
        k bodies' vertices, then the obstacles'. Edges that can touch others are turned to run alike at each step's
        start.
    parties : (k + obstacles' vertices,) int
        Whose each vertex is: bodies' numbers, then obstacles' after the last body's.
    candidates : ContactCandidates
        Pairs with a vertex of this rank's that can be within `reach` [m] of each other.
    """

    def __init__(self, space: LevelSpace, obstacles: tuple[Obstacle, ...], reach: float, ccd: str = "additive"):
        self.space, self.obstacles = space, obstacles
        d, level = space.dim, space.mesh
        self.surface, facets = np.unique(level.boundary, return_inverse=True)
        facets = facets.reshape(-1, d)
        if space.comm.size > 1:
            others = ~np.isin(self.surface, space.owned_points)
            order = np.argsort(others, kind="stable")
            self.surface, facets, own = self.surface[order], np.argsort(order)[facets], int(np.count_nonzero(~others))
        else:
            own = len(self.surface)
        vertices, edges, faces = [level.points[self.surface]], [], []
        if d == 2:
            edges.append(facets)
        else:
            faces.append(facets)
            edges.append(ipctk.edges(np.asfortranarray(facets, dtype=np.int32)))
        offset = len(self.surface)
        for obstacle in obstacles:
            vertices.append(obstacle.at(0.0))
            edges.append(obstacle.edges.reshape(-1, 2) + offset)
            faces.append(obstacle.faces.reshape(-1, 3) + offset)
            offset += len(obstacle.vertices)
        at_rest = np.concatenate(vertices)
        self.primitives = CollisionMesh(
            at_rest, np.concatenate(edges), np.concatenate(faces) if faces else np.zeros((0, 3)), own
        )
        self._start, self._aligned = None, -1
        owners = [np.full(len(o.vertices), int(level.point_bodies.max()) + 1 + i) for i, o in enumerate(obstacles)]
        self.parties = np.concatenate([level.point_bodies[self.surface], *owners])
        self._blocks = space.point_blocks[self.surface]
        # A pair that several ranks have a vertex of is counted by the one that owns the vertex that comes first in the
        # input.
        self._input_order = np.concatenate(
            [self.surface, np.full(len(self.parties) - len(self.surface), len(level.points))]
        )
        self._own = np.arange(len(self.parties)) < own
        self.obstacle_positions, self._at = self._obstacles_at(0.0), None
        self._narrow, self._goes_all_the_way = NARROW[ccd], ccd != "additive"
        self.candidates = ContactCandidates(self.primitives, at_rest, reach, not obstacles)

    @property
    def mesh(self) -> ipctk.CollisionMesh:
        """ipctk's mesh of the primitives."""
        return self.primitives.ipc

    def begin(self, vertices: np.ndarray) -> None:
        """Before a step that starts at `vertices`. Nothing after it depends on earlier steps, to the last digit."""
        self.candidates.forget()
        self._start, self._aligned = (
            vertices if self.space.dim == 3 else None,
            -1,
        )  # two edges never touch side by side in 2D

    def _alike(self, pairs: ipctk.Candidates) -> ipctk.Candidates:
        """The same pairs, after their edges that are new in this step were turned to run alike at its start."""
        if self._start is not None and self._aligned != self.candidates.searches and not pairs.empty():
            self.primitives.align(self._start, self.candidates.edges)
            self._aligned = self.candidates.searches
        return pairs

    def _obstacles_at(self, time: float) -> np.ndarray:
        placed = [o.at(time) for o in self.obstacles]
        return np.concatenate(placed) if placed else np.zeros((0, self.space.dim))

    def place(self, time: float) -> bool:
        """Puts the obstacles where they are at `time` [s]; says whether any moved."""
        positions = self._obstacles_at(time)
        changed = not np.array_equal(positions, self.obstacle_positions)
        if changed:
            self.obstacle_positions, self._at = positions, None
        return changed

    def vertices(self, x: Positions, at: float | None = None) -> np.ndarray:
        """Positions (k + obstacles, d) of the collision mesh, obstacles as placed or as they are `at` a time. First use
        per x is collective.
        """
        if at is None and x is self._at:
            return self._vertices
        obstacles = self.obstacle_positions if at is None else self._obstacles_at(at)
        vertices = np.asfortranarray(np.concatenate([x.whole[self.surface], obstacles]))
        if at is None:
            self._at, self._vertices = x, vertices
        return vertices

    def pairs(self, vertices: np.ndarray) -> ipctk.Candidates:
        """Pairs among which are all that touch at the collision mesh's positions."""
        return self._alike(self.candidates.at(vertices))

    def max_step(self, start: np.ndarray, end: np.ndarray, keep: float = KEPT) -> float:
        """Largest step in [0, 1] along straight paths that keeps everything apart, for this rank's pairs, and `keep` of
        every gap.
        """
        pairs = self._alike(self.candidates.along(start, end))
        if pairs.empty():
            return 1.0
        step = float(
            pairs.compute_collision_free_stepsize(
                mesh=self.mesh,
                vertices_t0=start,
                vertices_t1=end,
                min_distance=0.0,
                narrow_phase_ccd=self._narrow(keep),
            )
        )
        return (1.0 - keep) * step if self._goes_all_the_way and step < 1.0 else step

    def rows_of(self, values: np.ndarray) -> np.ndarray:
        """Owned rows (n_owned, d) of values over the collision mesh's unknowns, zero away from the surface. Sums over
        this rank's pairs are complete there.
        """
        whole = np.zeros((len(self.space.mesh.points), self.space.dim))
        whole[self.surface] = values.reshape(-1, self.space.dim)[: len(self.surface)]
        return self.space.from_input(whole)

    def of_vertices(self, values: np.ndarray) -> np.ndarray:
        """Rows of (n, ...) in the input's order for the collision mesh's vertices; zeros for obstacles'."""
        out = np.zeros((len(self.surface) + len(self.obstacle_positions), *values.shape[1:]))
        out[: len(self.surface)] = values[self.surface]
        return out

    def stencils(self, active: ipctk.NormalCollisions, vertices: np.ndarray) -> Stencils:
        """The active pairs at the collision mesh's positions, as arrays."""
        stencils = normal_stencils(active, self.primitives.edges, self.primitives.faces, vertices)
        if self.space.comm.size == 1:
            return stencils
        first = np.take_along_axis(
            stencils.vertices, self._input_order[stencils.vertices].argmin(axis=1)[:, None], axis=1
        )[:, 0]
        return replace(stencils, counted=self._own[first])

    def add_stencils(self, stencils: Stencils, middle: np.ndarray, into: HessianBlocks) -> None:
        """Adds C' M C of contact pairs; obstacles have no rows."""
        stencils.add(middle, self._blocks, into)

    def add_hessian(self, hessian, weight: float, into: HessianBlocks) -> None:
        """Adds a sparse Hessian over the collision mesh's unknowns; obstacles have none."""
        d, k = self.space.dim, len(self.surface)
        blocks = csr_array(hessian)[: k * d, : k * d].tobsr(blocksize=(d, d))
        into.add_pairs(
            self._blocks[np.repeat(np.arange(k), np.diff(blocks.indptr))],
            self._blocks[blocks.indices],
            weight * blocks.data,
        )
