"""The contact surface of one level: all bodies' boundaries and the rigid obstacles, in one set of primitives.

Its vertices are the bodies' boundary vertices, in the order of `surface`, and then the obstacles'. Every rank holds the
whole surface and all active pairs; ranks share the work of finding them.
"""

from collections.abc import Callable, Sequence

import numpy as np

from pdvol.compiled import pointer
from pdvol.levels.clocks import Clocks
from pdvol.levels.obstacles import Obstacle
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import PairList
from pdvol.potentials.contact.native import library
from pdvol.potentials.contact.primitives import Primitives
from pdvol.potentials.contact.stencils import Stencils
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions


class CollisionSurface:
    """Boundaries of a level with its obstacles. Construction is not collective.

    Parameters
    ----------
    space : LevelSpace
    obstacles : tuple of Obstacle
    dhat : distance [m] up to which pairs matter
    ccd : "additive" or "tight-inclusion"
    weighted : whether contacts weigh as much as their area; else each weighs as much as one
    clocks : of the obstacles' motions; all on time where not given

    Attributes
    ----------
    surface : (k,) int64
        Input indices of the bodies' boundary vertices.
    primitives : Primitives
        Of the bodies' k vertices and, behind them, the obstacles'.
    objects : (n,) int64
        Number of the body or obstacle that each of the surface's n vertices belongs to; obstacles are numbered after
        the bodies.
    lists : the candidates within bodies and between objects
    """

    def __init__(
        self,
        space: LevelSpace,
        obstacles: tuple[Obstacle, ...],
        dhat: float,
        ccd: str = "additive",
        weighted: bool = True,
        clocks: Clocks | None = None,
    ):
        self._clocks = Clocks() if clocks is None else clocks
        self.space, self.obstacles, self.dhat, self.ccd, level = space, obstacles, dhat, ccd, space.mesh
        boundary = np.unique(level.boundary)
        self.surface = boundary[np.argsort(level.point_bodies[boundary], kind="stable")]
        index = np.zeros(len(level.points), dtype=np.int64)
        index[self.surface] = np.arange(len(self.surface))
        vertices, facets = [level.points[self.surface]], [index[level.boundary]]
        bodies = int(level.point_bodies.max()) + 1
        numbers = [level.point_bodies[self.surface].astype(np.int64)]
        for i, obstacle in enumerate(obstacles):
            primitives = obstacle.edges if space.dim == 2 else obstacle.faces
            facets.append(primitives.reshape(-1, space.dim) + sum(map(len, vertices)))
            vertices.append(obstacle.at(0.0))
            numbers.append(np.full(len(obstacle.vertices), bodies + i))
        self.objects = np.concatenate(numbers)
        at_rest = np.concatenate(vertices)
        rigid = np.array([False] * bodies + [obstacle.rigid for obstacle in obstacles])
        self.primitives = Primitives(at_rest, np.concatenate(facets), self.objects, bodies, weighted, rigid)
        self._rows = np.full(len(at_rest), -1, dtype=np.int64)
        self._rows[: len(self.surface)] = space.point_blocks[self.surface]
        share = [self.primitives.leaves * (space.comm.rank + i) // space.comm.size for i in range(2)]
        leaves = share[0], share[1]
        self.lists = tuple(PairList(self.primitives, dhat, within, leaves) for within in (True, False))
        self.obstacle_positions = self._obstacles_at(0.0)
        self._at: Positions | None = None
        self._vertices: np.ndarray
        self._capacities = np.array([1024, 256])
        self._none = Stencils.room(0, 0, space.dim)

    def _obstacles_at(self, time: float) -> np.ndarray:
        placed = [o.at(self._clocks.of(o, time)) for o in self.obstacles]
        return np.concatenate(placed) if placed else np.zeros((0, self.space.dim))

    def move_obstacles(self, time: float) -> bool:
        """Puts the obstacles where they are at `time` [s]. Returns whether any of them moved."""
        positions = self._obstacles_at(time)
        changed = not np.array_equal(positions, self.obstacle_positions)
        if changed:
            self.obstacle_positions, self._at = positions, None
        return changed

    def vertices(self, x: Positions, at: float | None = None) -> np.ndarray:
        """(n, d) positions [m] of the surface's vertices; obstacles where they were placed, or where they are `at` a
        time [s]. First use per x is collective.
        """
        if at is None and x is self._at:
            return self._vertices
        obstacles = self.obstacle_positions if at is None else self._obstacles_at(at)
        vertices = np.concatenate([x.whole[self.surface], obstacles])
        if at is None:
            self._at, self._vertices = x, vertices
        return vertices

    def contacts(self, vertices: np.ndarray) -> Stencils:
        """All contacts nearer than dhat at positions (n, d), in an order that does not depend on ranks. Collective."""
        for pairs in self.lists:
            pairs.at(vertices)
        mine = [self._active(vertices, pairs.points, pairs.edges[:0]) for pairs in self.lists]
        mine += [self._active(vertices, pairs.points[:0], pairs.edges) for pairs in self.lists]
        if self.space.comm.size > 1:
            mine = [part for parts in zip(*self.space.comm.allgather(mine), strict=True) for part in parts]
        return Stencils.joined(mine)

    def _active(self, vertices: np.ndarray, points: np.ndarray, edges: np.ndarray) -> Stencils:
        """The contacts among candidate pairs of vertices and facets, and of edges, (k, 2) each."""
        if not (len(points) or len(edges)):
            return self._none
        d, counts = self.space.dim, np.zeros(2, dtype=np.int64)
        while True:
            k, f = self._capacities
            found = Stencils.room(k, f, d)
            if library().active_pairs(
                self.primitives.c,
                pointer(vertices),
                self.dhat,
                len(points),
                pointer(points, "int32_t"),
                len(edges),
                pointer(edges, "int32_t"),
                pointer(self._capacities, "int64_t"),
                pointer(found.vertices, "int32_t"),
                pointer(found.coefficients),
                pointer(found.gaps),
                pointer(found.weights),
                pointer(found.fading, "int64_t"),
                pointer(found.fades),
                pointer(found.curves),
                pointer(counts, "int64_t"),
            ):
                raise MemoryError("no memory left for contacts")
            if np.all(counts <= self._capacities):
                return found.first(*counts)
            self._capacities = np.maximum(self._capacities, 2 * counts)

    def _candidates(self, lists: Sequence[PairList]) -> tuple[np.ndarray, np.ndarray]:
        """Pairs (k, 2) of vertices and facets, and of edges, of lists of this rank."""
        return np.concatenate([pairs.points for pairs in lists]), np.concatenate([pairs.edges for pairs in lists])

    def max_step(self, start: np.ndarray, end: np.ndarray, gap_share: float = MIN_GAP_SHARE) -> float:
        """Largest step in [0, 1] along straight paths from start to end (n, d) at which all pairs of this rank stay
        apart, and keep at least the share `gap_share` of their gap, or of dhat where that is less.
        """
        # The pairs that are near stop most moves early. What else may meet is searched for on the way until then. Tight
        # inclusion may go further than conservative advancement, and needs the pairs of the whole way.
        additive = self.ccd == "additive"
        step = self._longest_step(start, end, gap_share, *self._candidates(self.lists)) if additive else 1.0
        searches = [pairs.searches for pairs in self.lists]
        for pairs in self.lists:
            pairs.along(start, end if step == 1.0 else start + step * (end - start))
        if not additive:
            return self._certified_step(start, end, gap_share, *self._candidates(self.lists))
        new = [pairs for pairs, before in zip(self.lists, searches, strict=True) if pairs.searches > before]
        return self._longest_step(start, end, gap_share, *self._candidates(new), step) if new else step

    def _longest_step(
        self,
        start: np.ndarray,
        end: np.ndarray,
        gap_share: float,
        points: np.ndarray,
        edges: np.ndarray,
        step: float = 1.0,
    ) -> float:
        return library().longest_step(
            self.primitives.c,
            pointer(start),
            pointer(end),
            self.dhat,
            gap_share,
            len(points),
            pointer(points, "int32_t"),
            len(edges),
            pointer(edges, "int32_t"),
            step,
        )

    def _certified_step(
        self, start: np.ndarray, end: np.ndarray, gap_share: float, points: np.ndarray, edges: np.ndarray
    ) -> float:
        """The step by tight inclusion, of the pairs that conservative advancement cannot clear. Tight inclusion goes to
        the contact itself, so its step is shortened afterwards.
        """
        import ipctk

        ccd, none, step = ipctk.TightInclusionCCD(tolerance=1e-6, max_iterations=1_000_000), points[:0], 1.0
        detect: Callable
        for pairs, is_point in ((points, True), (edges, False)):
            for k in range(len(pairs)):
                one = pairs[k : k + 1]
                if self._longest_step(start, end, gap_share, *((one, none) if is_point else (none, one))) == 1.0:
                    continue
                if is_point:
                    corners = [one[0, 0], *self.primitives.facets[one[0, 1]]]
                    detect = ccd.point_triangle_ccd if len(corners) == 4 else ccd.point_edge_ccd
                else:
                    corners, detect = [*self.primitives.edges[one[0]].ravel()], ccd.edge_edge_ccd
                hit, at = detect(*start[corners], *end[corners], min_distance=0.0, tmax=step)
                step = min(step, at) if hit else step
        return (1.0 - gap_share) * step if step < 1.0 else step

    def rows_of(self, values: np.ndarray) -> np.ndarray:
        """(n_owned, d) rows of the level from values (n, d) of the surface; zero away from it."""
        whole = np.zeros((len(self.space.mesh.points), self.space.dim))
        whole[self.surface] = values[: len(self.surface)]
        return self.space.from_input(whole)

    def of_vertices(self, values: np.ndarray) -> np.ndarray:
        """Values of the surface's vertices, from those of the level's points (m, ...) in the input's order; zeros at
        obstacles.
        """
        out = np.zeros((len(self.objects), *values.shape[1:]))
        out[: len(self.surface)] = values[self.surface]
        return out

    def add_tensors(self, stencils: Stencils, tensors: np.ndarray, into: HessianBlocks) -> None:
        """Adds the blocks c_i c_j T of contacts with symmetric tensors T (k, d, d); obstacles have no rows."""
        arguments = (
            self.space.dim,
            len(stencils),
            pointer(stencils.vertices, "int32_t"),
            pointer(stencils.coefficients),
            pointer(tensors),
        )
        self.add_blocks(library().tensor_blocks, arguments, len(stencils), into)

    def add_blocks(self, compiled: Callable, arguments: tuple, count: int, into: HessianBlocks) -> None:
        """Adds the blocks that a compiled function finds for `count` contacts, 10 each at most."""
        d = self.space.dim
        keys, blocks = np.empty((2, 10 * count), dtype=np.int64), np.empty((10 * count, d, d))
        found = compiled(
            *arguments,
            pointer(self._rows, "int64_t"),
            pointer(keys[0], "int64_t"),
            pointer(keys[1], "int64_t"),
            pointer(blocks),
        )
        into.add_pairs(keys[0, :found], keys[1, :found], blocks[:found])
