"""The collision geometry of one level: all bodies' boundaries and the rigid obstacles, in one collision mesh.

Its vertices are the bodies' boundary vertices, in the order of `surface`, and then the obstacles'. Every rank holds the
whole mesh, so contact does not depend on how the level is distributed.
"""

from dataclasses import replace

import ipctk
import numpy as np
from scipy.sparse import csr_array, sparray, spmatrix

from pdvol.levels.obstacles import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import ContactCandidates
from pdvol.potentials.contact.collision_mesh import CollisionMesh
from pdvol.potentials.contact.stencils import Stencils, normal_stencils
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions

NARROW_PHASES = {
    "additive": lambda gap_share: ipctk.AdditiveCCD(max_iterations=10_000, conservative_rescaling=1.0 - gap_share),
    "tight-inclusion": lambda gap_share: ipctk.TightInclusionCCD(tolerance=1e-6, max_iterations=1_000_000),
}
"""Continuous collision detection by name, as a function of the share of each gap that is kept.

Iterations bound the time of one pair: the detection ends there with a smaller step, which is safe. The additive kind
leaves a share of each gap by itself. Tight inclusion is exact to its tolerance [m] and goes to the contact itself, so
its steps are shortened afterwards.
"""

ipctk.set_num_threads(1)  # with one thread sums over contacts repeat to the last bit


class CollisionSurface:
    """Boundaries of a level with its obstacles. Construction is not collective.

    Parameters
    ----------
    space : LevelSpace
    obstacles : tuple of Obstacle
    reach : distance [m] up to which pairs matter
    ccd : a key of `NARROW_PHASES`

    Attributes
    ----------
    surface : (k,) int64
        Input indices of the bodies' boundary vertices, this rank's first.
    primitives : CollisionMesh
        Of the bodies' k vertices and, behind them, the obstacles'. Edges that can touch others are oriented alike at
        the start of each step.
    objects : (n,) int
        Number of the body or obstacle that each of the collision mesh's n vertices belongs to; obstacles are numbered
        after the bodies.
    candidates : ContactCandidates
        Pairs with a vertex of this rank that can be within `reach` of each other.
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
        self._start: np.ndarray | None = None
        self._oriented_search = -1
        numbers = [np.full(len(o.vertices), int(level.point_bodies.max()) + 1 + i) for i, o in enumerate(obstacles)]
        self.objects = np.concatenate([level.point_bodies[self.surface], *numbers])
        self._blocks = space.point_blocks[self.surface]
        # Of the ranks that hold a pair, the one with the pair's first vertex in the input's order owns it.
        self._input_index = np.concatenate(
            [self.surface, np.full(len(self.objects) - len(self.surface), len(level.points))]
        )
        self._is_own = np.arange(len(self.objects)) < own
        self.obstacle_positions = self._obstacles_at(0.0)
        self._at: Positions | None = None
        self._vertices: np.ndarray
        self._narrow_phase, self._stops_at_contact = NARROW_PHASES[ccd], ccd != "additive"
        self.candidates = ContactCandidates(self.primitives, at_rest, reach, not obstacles)

    @property
    def mesh(self) -> ipctk.CollisionMesh:
        """ipctk's mesh of the primitives."""
        return self.primitives.ipc

    def begin(self, vertices: np.ndarray) -> None:
        """Before a step that starts at `vertices` (n, d) [m]: forgets the candidates of earlier steps, so that not even
        the last digits depend on them.
        """
        self.candidates.forget()
        self._start = vertices if self.space.dim == 3 else None  # two edges never touch side by side in 2D
        self._oriented_search = -1

    def _with_oriented_edges(self, pairs: ipctk.Candidates) -> ipctk.Candidates:
        """The same pairs, after the edges of a new search have been oriented by their directions at the step's
        start.
        """
        if self._start is not None and self._oriented_search != self.candidates.searches and not pairs.empty():
            self.primitives.orient_edges(self._start, self.candidates.edges)
            self._oriented_search = self.candidates.searches
        return pairs

    def _obstacles_at(self, time: float) -> np.ndarray:
        placed = [o.at(time) for o in self.obstacles]
        return np.concatenate(placed) if placed else np.zeros((0, self.space.dim))

    def move_obstacles(self, time: float) -> bool:
        """Puts the obstacles where they are at `time` [s]. Returns whether any of them moved."""
        positions = self._obstacles_at(time)
        changed = not np.array_equal(positions, self.obstacle_positions)
        if changed:
            self.obstacle_positions, self._at = positions, None
        return changed

    def vertices(self, x: Positions, at: float | None = None) -> np.ndarray:
        """(n, d) positions [m] of the collision mesh's vertices; obstacles where they were placed, or where they are
        `at` a time [s]. First use per x is collective.
        """
        if at is None and x is self._at:
            return self._vertices
        obstacles = self.obstacle_positions if at is None else self._obstacles_at(at)
        vertices = np.asfortranarray(np.concatenate([x.whole[self.surface], obstacles]))
        if at is None:
            self._at, self._vertices = x, vertices
        return vertices

    def pairs(self, vertices: np.ndarray) -> ipctk.Candidates:
        """Candidates among which are all pairs nearer than the reach at the collision mesh's positions (n, d)."""
        return self._with_oriented_edges(self.candidates.at(vertices))

    def max_step(self, start: np.ndarray, end: np.ndarray, gap_share: float = MIN_GAP_SHARE) -> float:
        """Largest step in [0, 1] along straight paths from start to end (n, d) at which all pairs of this rank stay
        apart and keep at least the share `gap_share` of their gap.
        """
        pairs = self._with_oriented_edges(self.candidates.along(start, end))
        if pairs.empty():
            return 1.0
        step = float(
            pairs.compute_collision_free_stepsize(
                mesh=self.mesh,
                vertices_t0=start,
                vertices_t1=end,
                min_distance=0.0,
                narrow_phase_ccd=self._narrow_phase(gap_share),
            )
        )
        return (1.0 - gap_share) * step if self._stops_at_contact and step < 1.0 else step

    def rows_of(self, values: np.ndarray) -> np.ndarray:
        """(n_owned, d) rows of the level from values (n d,) of the collision mesh; zero away from the surface. Sums
        over this rank's pairs are complete in these rows.
        """
        whole = np.zeros((len(self.space.mesh.points), self.space.dim))
        whole[self.surface] = values.reshape(-1, self.space.dim)[: len(self.surface)]
        return self.space.from_input(whole)

    def of_vertices(self, values: np.ndarray) -> np.ndarray:
        """Values of the collision mesh's vertices, from those of the level's points (m, ...) in the input's order;
        zeros at obstacles.
        """
        out = np.zeros((len(self.surface) + len(self.obstacle_positions), *values.shape[1:]))
        out[: len(self.surface)] = values[self.surface]
        return out

    def stencils(self, active: ipctk.NormalCollisions, vertices: np.ndarray) -> Stencils:
        """The active pairs of this rank at the collision mesh's positions (n, d), as arrays."""
        stencils = normal_stencils(active, self.primitives.edges, self.primitives.faces, vertices)
        if self.space.comm.size == 1:
            return stencils
        first = np.take_along_axis(
            stencils.vertices, self._input_index[stencils.vertices].argmin(axis=1)[:, None], axis=1
        )[:, 0]
        return replace(stencils, owned=self._is_own[first])

    def add_stencils(self, stencils: Stencils, gap_hessian: np.ndarray, into: HessianBlocks) -> None:
        """Adds the contact pairs' Hessians, from those over their gaps (k, d, d) [N/m]; obstacles have no rows."""
        stencils.add(gap_hessian, self._blocks, into)

    def add_hessian(self, hessian: sparray | spmatrix, weight: float, into: HessianBlocks) -> None:
        """Adds `weight` times a sparse Hessian (n d, n d) of the collision mesh; obstacles have no rows."""
        d, k = self.space.dim, len(self.surface)
        blocks = csr_array(hessian)[: k * d, : k * d].tobsr(blocksize=(d, d))
        into.add_pairs(
            self._blocks[np.repeat(np.arange(k), np.diff(blocks.indptr))],
            self._blocks[blocks.indices],
            weight * blocks.data,
        )
