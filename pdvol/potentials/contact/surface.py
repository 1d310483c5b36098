"""The contact surface of one level: all bodies' boundaries, and the obstacles; its primitives as compiled loops take
them, the tree that searches them, and their flat parts.

Vertices and edges within flat parts of a surface cannot be the first that something touches. What meets a flat part
first is a vertex of the other side, or the part's outline: an edge that comes down on the part and crosses an edge
within it touches the part on a length, and that ends at the other edge's end or at the outline. So contacts of such
vertices and edges keep nothing apart. Where the surface is rigid they do harm. How many there are, and how near,
depends on how the part is cut into facets, so they would push along it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from pdvol.compiled import ffi, pointer
from pdvol.geometry.crossings import counted_edges
from pdvol.geometry.level_mesh import facet_sizes
from pdvol.levels.script import Mover, Obstacle, Script
from pdvol.levels.space import Collected, LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.potential import Positions

# facets of one leaf of the tree: smaller leaves make more nodes, larger ones more pairs that are tested in vain
LEAF_FACETS = 4
# C types of arrays; all others are of int32_t
C_TYPES = {"float64": "double", "int8": "int8_t", "bool": "uint8_t"}


class ContactSurface:
    """The bodies' boundary vertices, in the order of `surface`, and behind them the obstacles' vertices: those of rigid
    surfaces first, then those of planes, whose frames move as they do. Every rank holds the whole surface.

    Parameters
    ----------
    obstacles : tuple of Obstacle
    script : of the obstacles' motions; all on time where not given

    Attributes
    ----------
    surface : (k,) int64
        Input indices of the bodies' boundary vertices.
    objects : (n,) int64
        Number of the body or obstacle that each of the surface's n vertices belongs to; obstacles are numbered after
        the bodies.
    rows : (n,) int64
        Row of the level that each vertex has, in PETSc's block order; -1 for obstacles.
    primitives : Primitives
        Of all but planes.
    obstacle_positions : (m, d) [m]
        Where the obstacles' vertices are now.
    version : how often these have changed
    """

    def __init__(self, space: LevelSpace, obstacles: tuple[Obstacle, ...] = (), script: Script | None = None):
        self.space, self.obstacles, level = space, obstacles, space.mesh
        self._script = Script() if script is None else script
        boundary = np.unique(level.boundary)
        self.surface = boundary[np.argsort(level.point_bodies[boundary], kind="stable")]
        k, bodies = len(self.surface), int(level.point_bodies.max()) + 1
        shapes = [o for o in obstacles if o.kind != "plane"]
        self._placed = (*shapes, *(o for o in obstacles if o.kind == "plane"))
        sizes = [len(o.vertices) for o in self._placed]
        numbers = np.array([bodies + obstacles.index(o) for o in self._placed], dtype=np.int64)
        of_bodies = level.point_bodies[self.surface].astype(np.int64)
        self.objects = np.concatenate([of_bodies, np.repeat(numbers, sizes)])
        self._moves = any(o.moves for o in obstacles)
        self.obstacle_positions = self._obstacles_at(0.0)
        self.version = 0

        first, last = space.first_block, space.first_block + space.n_owned
        self.rows = np.full(len(self.objects), -1, dtype=np.int64)
        self.rows[:k] = space.point_blocks[self.surface]
        owned = np.where(self.rows < 0, -1, (self.rows >= first) & (self.rows < last)).astype(np.int8)
        self._own = np.flatnonzero(owned == 1)
        self._own_rows = self.rows[self._own] - first
        self._collected = Collected(space.comm, self._own)

        index = np.zeros(len(level.points), dtype=np.int64)
        index[self.surface] = np.arange(k)
        starts = k + np.cumsum([0, *sizes])[: len(shapes)]
        facets = [index[level.boundary]]
        for start, shape in zip(starts, shapes, strict=True):
            facets.append((shape.edges if space.dim == 2 else shape.faces).reshape(-1, space.dim) + start)
        count = k + sum(sizes[: len(shapes)])
        self.primitives = Primitives(
            np.concatenate([level.points[self.surface], self.obstacle_positions])[:count],
            np.concatenate(facets),
            np.concatenate([of_bodies, bodies + np.repeat(np.arange(len(shapes)), sizes[: len(shapes)])]),
            bodies,
            np.array([False] * bodies + [shape.rigid for shape in shapes]),
            owned[:count],
            len(obstacles) - len(shapes),
        )

    def _obstacles_at(self, time: float, lags: Mapping[Mover, float] | None = None) -> np.ndarray:
        script = self._script if lags is None else self._script.at(time, lags)
        placed = [np.zeros((0, self.space.dim))]
        for obstacle in self._placed:
            plane = obstacle.kind == "plane"
            placed.append(script.pose(obstacle, time)(obstacle.vertices) if plane else script.place(obstacle, time))
        return np.concatenate(placed)

    def move_obstacles(self, time: float) -> bool:
        """Puts the obstacles where they are at `time` [s]. Returns whether any of them moved."""
        positions = self._obstacles_at(time) if self._moves else self.obstacle_positions
        changed = self._moves and not np.array_equal(positions, self.obstacle_positions)
        if changed:
            self.obstacle_positions, self.version = positions, self.version + 1
        return changed

    def vertices(self, x: Positions, at: float | None = None, lags: Mapping[Mover, float] | None = None) -> np.ndarray:
        """(n, d) positions [m] of the surface's vertices; obstacles where they were placed, or where they are `at` a
        time [s] of the present span, or where they were at an earlier one, late by their `lags` [s]. First use per x is
        collective.
        """
        if at is not None and self._moves:
            return np.concatenate([self.of_bodies(x.owned), self._obstacles_at(at, lags)])
        find = lambda: np.concatenate([self.of_bodies(x.owned), self.obstacle_positions])
        return x.get((self, "vertices"), find, self.version)

    def of_bodies(self, rows: np.ndarray) -> np.ndarray:
        """(k, d) values of the bodies' vertices, from this rank's rows (n_owned, d) of the level. Collective."""
        return rows[self._own_rows] if self.space.comm.size == 1 else self._collected(rows[self._own_rows])

    def add_blocks(self, into: HessianBlocks, loop: str, count: int, *arguments: object) -> None:
        """Adds the blocks that a compiled loop finds for so many contacts, ten for each at most."""
        if count:
            into.add_compiled(getattr(library[self.space.dim], loop), 10 * count, self.rows, *arguments)

    def rows_of(self, values: np.ndarray) -> np.ndarray:
        """(n_owned, d) rows of the level from values (n, d) of the surface; zero away from it."""
        rows = np.zeros((self.space.n_owned, self.space.dim))
        rows[self._own_rows] = values[self._own]
        return rows


class Primitives:
    """The primitives of bodies and rigid surfaces; facets are edges in 2D and triangles in 3D.

    Parameters
    ----------
    vertices : (n, d) positions at rest [m]
    facets : (f, d) int
    objects : (n,) int
        Number of the body or obstacle of each vertex; bodies first.
    bodies : number of bodies
    rigid : (objects,) bool
        Objects that keep their shape. Their vertices and edges within flat parts are found by no search.
    owned : (n,) int8
        1 where a vertex is of this rank, 0 where it is of another one, and -1 on obstacles.
    planes : number of half-spaces, whose frames stand behind the vertices

    Attributes
    ----------
    edges : (e, 2) int32
        Sides of facets in 3D; none in 2D.
    lines, triangles : (k, 2), (f, 3) int32
        Edges and triangles; in 2D facets and none.
    edge_length, edge_lengths : median length [m] at rest of edges (3D) or facets (2D), of all bodies together and of
        each object (objects,)
    roots : (objects + 1,) int32
        Where the nodes of each object begin.
    boxes : number of nodes, facets and edges
    owned_objects : (objects,) bool
        Those with vertices of this rank.
    c : the C struct of all this
    loops : the compiled functions for its dimension
    """

    def __init__(
        self,
        vertices: np.ndarray,
        facets: np.ndarray,
        objects: np.ndarray,
        bodies: int,
        rigid: np.ndarray,
        owned: np.ndarray,
        planes: int = 0,
    ):
        self.d, self.bodies, self.planes = vertices.shape[1], bodies, planes
        self.loops = library[self.d]
        self.objects, self.facets = objects.astype(np.int64), np.ascontiguousarray(facets, dtype=np.int32)
        n, d = len(vertices), self.d
        if d == 3:
            edges, of_facets, _ = counted_edges(self.facets)
            self.edges, facet_edges = edges.astype(np.int32), of_facets.reshape(-1, 3)
        else:
            self.edges, facet_edges = np.zeros((0, 2), dtype=np.int32), np.zeros((0, 3), dtype=np.int64)
        self.lines = self.edges if d == 3 else self.facets
        self.triangles = self.facets if d == 3 else np.zeros((0, 3), np.int32)
        lengths = np.linalg.norm(vertices[self.lines[:, 1]] - vertices[self.lines[:, 0]], axis=1)
        of = self.objects[self.lines[:, 0]]
        self.edge_length = float(np.median(lengths[of < bodies])) if (of < bodies).any() else 0.0
        self.edge_lengths = np.array([np.median(lengths[of == o]) for o in range(len(rigid))])
        sizes = facet_sizes(vertices, self.facets)
        areas = 0.5 * np.bincount(self.facets.ravel(), np.repeat(sizes / d, d), minlength=n)  # both sides count
        beside = np.repeat(sizes[: len(facet_edges)] / 3.0, 3)
        edge_areas = 0.5 * np.bincount(facet_edges.ravel(), beside, minlength=len(self.edges))
        # In a union a facet counts once; an edge and a vertex as often as is left to one after what contains them.
        edge_share = 1 - np.bincount(facet_edges.ravel(), minlength=len(self.edges))
        vertex_share = 1 - np.bincount(self.facets.ravel(), minlength=n)
        vertex_share -= np.bincount(self.edges.ravel(), np.repeat(edge_share, 2), minlength=n).astype(int)
        self._arrays: dict[str, np.ndarray] = {
            "edge": self.edges,
            "facet": self.facets,
            "facet_edges": facet_edges,
            "vertex_share": vertex_share,
            "edge_share": edge_share,
            "areas": areas,
            "edge_areas": edge_areas,
            "owned": owned,
        }
        of_rigid = rigid[self.objects[self.facets[:, 0]]]
        own_edges = facet_edges[of_rigid] if d == 3 else facet_edges
        self._build_tree(
            vertices,
            facet_edges,
            (owned[self.facets] == 1).any(axis=1),
            *flat_parts(vertices, self.facets[of_rigid], self.edges, own_edges),
        )
        of_objects = np.zeros(len(self.roots) - 1, dtype=bool)
        of_objects[self.objects[owned == 1]] = True
        self.owned_objects = of_objects
        self.boxes = int(self.roots[-1]) + len(self.facets) + len(self.edges)
        self.c = self._struct(n)

    def _build_tree(
        self,
        vertices: np.ndarray,
        facet_edges: np.ndarray,
        owned_facets: np.ndarray,
        no_vertices: np.ndarray,
        no_edges: np.ndarray,
    ) -> None:
        """The tree of each object, nodes in the order of a walk through it: a node's first child follows it. Marked
        vertices (n,) and edges (e,) are in no leaf. Nodes with facets that are marked as owned (f,) hold some.
        """
        middles = vertices[self.facets].mean(axis=1)
        owner = self.objects[self.facets[:, 0]]
        skip: list[int] = []
        holds: list[bool] = []
        leaf: list[int] = []
        leaves: list[np.ndarray] = []
        roots = [0]
        for number in range(int(self.objects.max()) + 1):
            pending = [np.flatnonzero(owner == number)]
            closing: list[tuple[int, int]] = []  # node, and how many are pending when its subtree is complete
            while pending and len(pending[-1]):
                facets = pending.pop()
                node = len(skip)
                skip.append(0)
                holds.append(bool(owned_facets[facets].any()))
                if len(facets) <= LEAF_FACETS:
                    leaf.append(len(leaves))
                    leaves.append(facets)
                    skip[node] = len(skip)
                    while closing and closing[-1][1] == len(pending):
                        skip[closing.pop()[0]] = len(skip)
                else:
                    leaf.append(-1)
                    closing.append((node, len(pending)))
                    at = middles[facets]
                    order = np.argsort(at[:, np.ptp(at, axis=0).argmax()], kind="stable")
                    pending += [facets[order[len(order) // 2 :]], facets[order[: len(order) // 2]]]
            roots.append(len(skip))
        self.roots, self.leaves = np.array(roots, dtype=np.int32), len(leaves)
        everything = np.concatenate(leaves)
        home = np.empty(len(self.facets), dtype=np.int64)
        home[everything] = np.repeat(np.arange(len(leaves)), [len(facets) for facets in leaves])
        self._arrays |= {"skip": np.array(skip), "leaf": np.array(leaf), "roots": self.roots, "holds": np.array(holds)}
        for primitives, of_facets, nowhere in (
            ("facet", np.arange(len(self.facets))[:, None], np.zeros(len(self.facets), dtype=bool)),
            ("vertex", self.facets, no_vertices),
            ("edge", facet_edges, no_edges),
        ):
            first = np.full(len(nowhere), len(leaves))  # of the leaves that it is in
            np.minimum.at(first, of_facets, home[: len(of_facets), None])
            first[nowhere] = len(leaves)
            order = np.argsort(first, kind="stable")
            plural = "vertices" if primitives == "vertex" else f"{primitives}s"
            self._arrays[f"leaf_{plural}"] = order
            self._arrays[f"leaf_{primitives}_starts"] = np.searchsorted(first[order], np.arange(len(leaves) + 1))

    def _struct(self, n: int) -> Any:
        struct = ffi.new("surface_t *")
        struct.vertices, struct.edges, struct.facets = n, len(self.edges), len(self.facets)
        struct.objects, struct.leaves, struct.planes = len(self.roots) - 1, self.leaves, self.planes
        self._kept = []
        for name, array in self._arrays.items():
            kind = C_TYPES.get(array.dtype.name, "int32_t")
            plain = np.ascontiguousarray(array, dtype=np.int32 if kind == "int32_t" else array.dtype)
            self._kept.append(pointer(plain, kind))
            setattr(struct, name, self._kept[-1])
        return struct


# sine of the angle between facets of one flat part: round-off of coordinates that were turned and shifted
FLAT_SINE = 1e-10


def flat_parts(
    vertices: np.ndarray, facets: np.ndarray, edges: np.ndarray, facet_edges: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Masks of vertices (n,) with nothing but one flat part around them, and of edges (e,) between two facets of it.

    Parameters
    ----------
    vertices : (n, d)
    facets : (f, d) int
    edges : (e, 2) int
        None in 2D, where facets are edges.
    facet_edges : (f, 3) int
        Of the sides of each facet, from its corners 0, 1, 2 on; in 3D alone.
    """
    n, d = vertices.shape
    if d == 2:
        two, first, second = _pairs(facets.ravel(), n)
        along = (vertices[facets[:, 1]] - vertices[facets[:, 0]]).repeat(2, axis=0)
        along[::2] *= -1.0  # towards the vertex
        return _same_direction(two, along[first], -along[second], n), np.zeros(0, dtype=bool)
    two, first, second = _pairs(facet_edges.ravel(), len(edges))
    apexes = vertices[facets[:, [2, 0, 1]].ravel()]
    start, end = vertices[edges[two]].swapaxes(0, 1)
    flat = _same_direction(
        two, np.cross(end - start, apexes[first] - start), np.cross(apexes[second] - start, end - start), len(edges)
    )
    inside = np.bincount(facets.ravel(), minlength=n) > 0
    inside[edges[~flat]] = False
    return inside, flat


def _pairs(of: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The numbers below `count` that occur twice in `of` (k,), and where they are."""
    order = np.argsort(of, kind="stable")
    starts = np.searchsorted(of[order], np.arange(count + 1))
    two = np.flatnonzero(np.diff(starts) == 2)
    return two, order[starts[two]], order[starts[two] + 1]


def _same_direction(chosen: np.ndarray, one: np.ndarray, other: np.ndarray, count: int) -> np.ndarray:
    """Mask (count,) of those chosen for which two vectors have the same direction."""
    sizes = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    turned = np.cross(one, other) if one.shape[1] == 3 else one[:, :1] * other[:, 1:] - one[:, 1:] * other[:, :1]
    mask = np.zeros(count, dtype=bool)
    mask[chosen] = (np.linalg.norm(turned, axis=1) <= FLAT_SINE * sizes) & (np.einsum("ki,ki->k", one, other) > 0.0)
    return mask
