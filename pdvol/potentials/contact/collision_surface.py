"""The contact surface of one level: all bodies' boundaries and the rigid obstacles, in one set of primitives.

Its vertices are the bodies' boundary vertices, in the order of `surface`, and then the obstacles'. Every rank holds the
whole surface, and the contacts that touch its own vertices.
"""

from collections.abc import Callable

import numpy as np

from pdvol.compiled import pointer
from pdvol.levels.obstacles import Obstacle
from pdvol.levels.script import Script
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.candidates import PairList, Stencils
from pdvol.potentials.contact.native import ffi, library
from pdvol.potentials.contact.surface import Primitives
from pdvol.potentials.potential import MIN_GAP_SHARE, Positions


class CollisionSurface:
    """Boundaries of a level with its obstacles. Construction is not collective.

    Parameters
    ----------
    space : LevelSpace
    obstacles : tuple of Obstacle
    dhat : distance [m] up to which pairs matter
    ccd : "additive" or "tight-inclusion"
    script : of the obstacles' motions; all on time where not given

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
        script: Script | None = None,
    ):
        self._script = Script() if script is None else script
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
        self._rows = np.full(len(at_rest), -1, dtype=np.int64)
        self._rows[: len(self.surface)] = space.point_blocks[self.surface]
        first, last = space.first_block, space.first_block + space.n_owned
        self._own = np.flatnonzero((self._rows >= first) & (self._rows < last))
        self._own_rows = self._rows[self._own] - first
        owned = np.where(self._rows < 0, -1, (self._rows >= first) & (self._rows < last)).astype(np.int8)
        self.primitives = Primitives(at_rest, np.concatenate(facets), self.objects, bodies, rigid, owned)
        self.lists = tuple(PairList(self.primitives, dhat, within) for within in (True, False))
        self._c_lists = ffi.new("pairs_t *[]", [pairs.c for pairs in self.lists])
        self.obstacle_positions = self._obstacles_at(0.0)
        self._at: Positions | None = None
        self._vertices: np.ndarray
        self._room, self._none = Stencils.room(1024, 256, space.dim), Stencils.room(0, 0, space.dim)

    def _obstacles_at(self, time: float) -> np.ndarray:
        placed = [self._script.place(o, time) for o in self.obstacles]
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
        bodies = x.owned[self._own_rows] if self.space.comm.size == 1 else x.whole[self.surface]
        vertices = np.concatenate([bodies, obstacles])
        if at is None:
            self._at, self._vertices = x, vertices
        return vertices

    def contacts(self, vertices: np.ndarray) -> Stencils:
        """The contacts nearer than dhat at positions (n, d) that touch this rank's vertices, and some of others that do
        not count: of points, list by list, and then of edges. Their order does not depend on ranks.
        """
        for pairs in self.lists:
            pairs.at(vertices)
            pairs.ask_about(vertices)
        counts = np.zeros(2, dtype=np.int64)
        while any(len(pairs.points) or len(pairs.edges) for pairs in self.lists):
            if library().active_pairs(
                self.primitives.c,
                pointer(vertices),
                self.dhat,
                len(self.lists),
                self._c_lists,
                self._room.c,
                pointer(counts, "int64_t"),
            ):
                raise MemoryError("no memory left for contacts")
            count, faded = counts.tolist()
            if count <= self._room.c.count and faded <= self._room.c.faded:
                return self._room.first(count, faded) if count else self._none
            self._room = Stencils.room(2 * count, 2 * faded + 256, self.space.dim)
        return self._none

    def max_step(self, start: np.ndarray, end: np.ndarray, gap_share: float = MIN_GAP_SHARE) -> float:
        """Largest step in [0, 1] along straight paths from start to end (n, d) at which all pairs of this rank stay
        apart, and keep at least the share `gap_share` of their gap, or of dhat where that is less.
        """
        # The pairs that are near stop most moves early. What else may meet is searched for on the way until then. Tight
        # inclusion may go further than conservative advancement, and needs the pairs of the whole way.
        additive, step = self.ccd == "additive", 1.0
        for pairs in self.lists if additive else ():
            step = pairs.longest_step(start, end, gap_share, step)
        searches = [pairs.searches for pairs in self.lists]
        for pairs in self.lists:
            pairs.along(start, end if step == 1.0 else start + step * (end - start))
        if not additive:
            return self._certified_step(start, end, gap_share)
        for pairs, before in zip(self.lists, searches, strict=True):
            if pairs.searches > before:
                step = pairs.longest_step(start, end, gap_share, step)
        return step

    def _certified_step(self, start: np.ndarray, end: np.ndarray, gap_share: float) -> float:
        """The step by tight inclusion, of the pairs that conservative advancement cannot clear. Tight inclusion goes to
        the contact itself, so its step is shortened afterwards.
        """
        import ipctk

        ccd, step = ipctk.TightInclusionCCD(tolerance=1e-6, max_iterations=1_000_000), 1.0
        move = pointer(start), pointer(end)
        detect: Callable
        for is_point in (True, False):
            for one in np.concatenate([pairs.points if is_point else pairs.edges for pairs in self.lists]):
                alone = ffi.new("pairs_t *", {"n_points": int(is_point), "n_edges": int(not is_point)})
                alone.points = alone.edges = pointer(one, "int32_t")
                if library().longest_step(self.primitives.c, *move, self.dhat, gap_share, alone, 1.0) == 1.0:
                    continue
                if is_point:
                    corners = [one[0], *self.primitives.facets[one[1]]]
                    detect = ccd.point_triangle_ccd if len(corners) == 4 else ccd.point_edge_ccd
                else:
                    corners, detect = [*self.primitives.edges[one].ravel()], ccd.edge_edge_ccd
                hit, at = detect(*start[corners], *end[corners], min_distance=0.0, tmax=step)
                step = min(step, at) if hit else step
        return (1.0 - gap_share) * step if step < 1.0 else step

    def rows_of(self, values: np.ndarray) -> np.ndarray:
        """(n_owned, d) rows of the level from values (n, d) of the surface; zero away from it."""
        rows = np.zeros((self.space.n_owned, self.space.dim))
        rows[self._own_rows] = values[self._own]
        return rows

    def of_vertices(self, values: np.ndarray) -> np.ndarray:
        """Values of the surface's vertices, from those of the level's points (m, ...) in the input's order; zeros at
        obstacles.
        """
        out = np.zeros((len(self.objects), *values.shape[1:]))
        out[: len(self.surface)] = values[self.surface]
        return out

    def add_tensors(self, stencils: Stencils, tensors: np.ndarray, into: HessianBlocks) -> None:
        """Adds the blocks c_i c_j T of contacts with symmetric tensors T (k, d, d); obstacles have no rows."""
        self.add_blocks(library().tensor_blocks, into, stencils, pointer(tensors))

    def add_blocks(
        self, function: Callable[..., int], into: HessianBlocks, stencils: Stencils, *others: object
    ) -> None:
        """Adds the blocks that a compiled function finds for contacts, 10 each at most."""
        rows = pointer(self._rows, "int64_t")
        into.add_compiled(function, 10 * len(stencils), self.space.dim, stencils.c, *others, rows)
