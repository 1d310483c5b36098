"""Intersections of bodies with themselves, each other, obstacles and planes: the state every level starts from must be
free of them.

Written apart from the solver's contact code. Separately decimated surfaces can cross where the originals do not, so
every level is tested.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.errors import InputError, IntersectionError
from pdvol.geometry.boundary_search import enclosed, nearest_points
from pdvol.geometry.crossings import edges_of, find_crossings, find_touching, fortran
from pdvol.geometry.level_mesh import LevelMesh, connected_parts
from pdvol.geometry.rigid_motions import Pose
from pdvol.levels.script import Obstacle

ROUNDING = 1e-6  # of a depth: smaller coordinates are shown as 0
TRIED_VERTICES = 200  # of an obstacle, to see whether it is inside another one
WORDS = {1: "vertex", 2: "edge", 3: "triangle"}
MEND = "move them apart, or give more vertices to coarse levels"
MEND_LEVEL = "on level {free} they are apart: give level {level} more vertices or a mesh of its own, or move them apart"


@dataclass(frozen=True, eq=False)
class Defect:
    """What stops a run on a level: mostly something that crosses, touches or contains another at t = 0.

    Attributes
    ----------
    error : names what is wrong, where, and how to mend it
    primitives : (k, d) corners [m] of each primitive, two for each pair where two are involved; none if it has no
        place
    """

    error: InputError
    primitives: list[np.ndarray]


def _where(level: int | None) -> tuple[str, str]:
    """How a message begins, and when it is."""
    return ("", "at u") if level is None else (f"level {level}: ", "at t = 0")


def find_defects(
    level: int | None,
    mesh: LevelMesh,
    obstacles: Sequence[Obstacle],
    bodies: Sequence[str],
    level_meshes: Sequence[LevelMesh] = (),
) -> Iterator[Defect]:
    """What crosses, touches or contains another on a level of a scene with contact at t = 0, found one after the other.
    Serial. An error names the level, the two bodies or obstacles, and example primitives; its `pairs` has all of them,
    by their vertices, numbered as in the level's mesh or in the obstacle. Raises InputError where an obstacle's
    dimension is not the bodies'.

    Parameters
    ----------
    level : None where the mesh is a user's own, at displacements u
    mesh : of the level, with its points where they are at t = 0 (`started`)
    obstacles : of the scene
    bodies : their names
    level_meshes : all levels, coarsest first; where the finest keeps apart what meets on this level, errors say so
    """
    for plane in _planes(obstacles):
        yield from _below(level, mesh, plane, bodies)
    finer = level is not None and len(level_meshes) - 1 > level

    def apart(one: int, other: int) -> int | None:
        """The finest level, where two owners of boundaries are apart there."""
        met = _Boundaries(level_meshes[-1], obstacles, bodies).meet(one, other) if finer else True
        return None if met else len(level_meshes) - 1

    boundaries = _Boundaries(mesh, obstacles, bodies)
    crossings = list(boundaries.crossings(level, apart))
    yield from crossings or boundaries.contained(level, apart)  # boundaries that cross may also count as inside


def smallest_gap(
    mesh: LevelMesh, obstacles: Sequence[Obstacle], bodies: Sequence[str], reach: float
) -> tuple[dict[str, Any] | None, int]:
    """The smallest gap at t = 0 up to `reach` [m], if there is one: its `distance` [m] and both primitives in words,
    `one` and `other`; and how many pairs of primitives are that near. Nothing may cross.
    """
    gap, count = _Boundaries(mesh, obstacles, bodies).gap(reach)
    for plane in _planes(obstacles):
        height = _heights(mesh.points, plane)
        nearest = int(np.argmin(height))
        count += int((height < reach).sum())
        if height[nearest] < (reach if gap is None else gap["distance"]):
            body = bodies[mesh.point_bodies[nearest]]
            one = f"vertex {nearest} of body {body!r}"
            gap = {"distance": float(height[nearest]), "one": one, "other": plane.label}
    return gap, count


def count_intersections(
    mesh: LevelMesh,
    positions: np.ndarray,
    obstacles: Sequence[Obstacle],
    bodies: Sequence[str],
    places: Mapping[Obstacle, Any],
) -> int:
    """Number of intersections in a state without contact: pairs of edges (2D) or of edges and triangles (3D), and
    vertices at or below planes. Serial.

    Parameters
    ----------
    positions : (n, d) [m]
    obstacles, bodies : as `find_defects` takes them
    places : of the obstacles, each a `Place`
    """
    behind = sum(int(np.sum(_heights(positions, plane, places[plane]) <= 0.0)) for plane in _planes(obstacles))
    return behind + len(_Boundaries(mesh, obstacles, bodies, positions, places).crossing_pairs())


def _planes(obstacles: Sequence[Obstacle]) -> list[Obstacle]:
    return [obstacle for obstacle in obstacles if obstacle.kind == "plane"]


def _heights(points: np.ndarray, plane: Obstacle, place: Pose | None = None) -> np.ndarray:
    """(n,) heights [m] of points (n, d) above a plane where it is placed, or at t = 0."""
    dim, given = points.shape[1], plane.vertices.shape[1]
    if given != dim:
        raise InputError(f"{plane.label} is {given}D in a {dim}D scene; give {dim} components")
    point, normal = plane.plane_at(0.0 if place is None else place)
    return (points - point) @ normal


def buried(obstacles: Sequence[Obstacle]) -> Iterator[tuple[Obstacle, Obstacle]]:
    """Obstacles that lie wholly behind a plane or inside another one at t = 0, which no body can reach there: each with
    the one that hides it.
    """
    surfaces = [(o, o.at(0.0)) for o in obstacles if o.kind != "plane"]
    for inner, points in surfaces:
        tried = points[:: 1 + len(points) // TRIED_VERTICES]
        for outer in obstacles:
            if outer is inner or not outer.closed:
                continue
            if outer.kind == "plane":
                hidden = points.shape[1] == outer.vertices.shape[1] and bool((_heights(points, outer) < 0.0).all())
            else:
                around = next(p for o, p in surfaces if o is outer)
                facets = outer.faces if outer.kind == "mesh" else outer.edges
                hidden = _within(points, around) and bool(enclosed(tried, around, facets).all())
            if hidden:
                yield inner, outer


def _within(points: np.ndarray, others: np.ndarray) -> bool:
    """Whether the box around points (n, d) is within that around others (k, d)."""
    return points.shape[1] == others.shape[1] and bool(
        (points.min(axis=0) > others.min(axis=0)).all() and (points.max(axis=0) < others.max(axis=0)).all()
    )


def _below(level: int | None, mesh: LevelMesh, plane: Obstacle, bodies: Sequence[str]) -> Iterator[Defect]:
    height = _heights(mesh.points, plane)
    below = np.flatnonzero(height <= 0.0)
    if len(below):
        worst = int(np.argmin(height))
        body = bodies[mesh.point_bodies[worst]]
        many = f"{len(below)} vertices are" if len(below) > 1 else "1 vertex is"
        of, when = _where(level)
        yield Defect(
            IntersectionError(
                f"{of}{many} at or below {plane.label} {when}, the worst vertex {worst} of body"
                f" {body!r} by {-height[worst]:.3g} m; lift the body, lower the plane or turn its normal",
                [(int(v),) for v in below],
                level or 0,
                (mesh.point_bodies[worst],),
                plane.plane_at(0.0)[1],
            ),
            [mesh.points[[v]] for v in below],
        )


class _Boundaries:
    """All boundaries of one level, at rest or at positions (n, d), in one set of arrays: bodies first (owner >= 0),
    then obstacles in their places, those at t = 0 where none are given.
    """

    def __init__(
        self,
        mesh: LevelMesh,
        obstacles: Sequence[Obstacle],
        bodies: Sequence[str],
        positions: np.ndarray | None = None,
        places: Mapping[Obstacle, Any] | None = None,
    ):
        surfaces = [o for o in obstacles if o.kind != "plane"]
        positions = mesh.points if positions is None else positions
        self.names = [f"body {name!r}" for name in bodies] + [surface.label for surface in surfaces]
        self.closed = [True] * len(bodies) + [surface.closed for surface in surfaces]
        self.bodies = len(bodies)
        # Inner points of a body cannot cross anything before its boundary does.
        used = np.unique(mesh.boundary)
        points, owners, first = [positions[used]], [mesh.point_bodies[used]], len(used)
        number = np.full(len(mesh.points), -1, dtype=np.int64)
        number[used] = np.arange(len(used))
        facets, labels = [number[mesh.boundary]], [used]
        for k, surface in enumerate(surfaces):
            count, dim = surface.vertices.shape
            if dim != mesh.dim:
                raise InputError(f"{surface.label} is {dim}D in a {mesh.dim}D scene; give it {mesh.dim} dimensions")
            points.append(surface.place(0.0) if places is None else places[surface])
            owners.append(np.full(count, self.bodies + k))
            facets.append((surface.faces if mesh.dim == 3 else surface.edges) + first)
            labels.append(np.arange(count))
            first += count
        self.points, self.owner, self.labels = np.vstack(points), np.concatenate(owners), np.concatenate(labels)
        self.facets = np.vstack(facets).astype(np.int64)
        self.edges = edges_of(self.facets)
        self.faces = self.facets if mesh.dim == 3 else np.empty((0, 3), dtype=np.int64)
        self.second = self.edges if mesh.dim == 2 else self.faces  # what edges cross
        boxes = (np.ptp(self.points[self.owner == body], axis=0) for body in np.unique(self.owner[: len(used)]))
        self.smallest = min(float(np.linalg.norm(box)) for box in boxes)  # of the bodies' diagonals [m]

    def _whose(self, vertex: int) -> str:
        return self.names[self.owner[vertex]]

    def crossing_pairs(self) -> np.ndarray:
        """As `find_crossings` gives them."""
        return find_crossings(self.points, self.edges, self.faces, np.where(self.owner >= self.bodies, -1, 0))

    def meet(self, one: int, other: int) -> bool:
        """Whether the boundaries of two owners cross, or one lies inside the other."""
        crossing = {
            frozenset((self.owner[self.edges[a][0]], self.owner[self.second[b][0]])) for a, b in self.crossing_pairs()
        }
        return frozenset((one, other)) in crossing or any(
            {outer, *self.owner[inside]} == {one, other} for outer, inside in self._inside()
        )

    def crossings(self, level: int | None, apart: Callable[[int, int], int | None]) -> Iterator[Defect]:
        """Boundaries that cross, or else touch. `apart` gives the level on which two owners are apart, if one is."""
        obstacle = np.where(self.owner >= self.bodies, -1, 0)
        pairs = self.crossing_pairs()
        if len(pairs):
            yield self._defect(level, "crosses", apart, [(self.edges[a], self.second[b]) for a, b in pairs])
            return
        touching = find_touching(self.points, self.edges, self.faces, obstacle, self.smallest)
        if len(touching):
            yield self._defect(level, "touches", apart, [([a], [b]) for a, b in touching])

    def gap(self, reach: float) -> tuple[dict[str, Any] | None, int]:
        """As `smallest_gap`, of the boundaries alone."""
        import ipctk

        vertices, edges, faces = fortran(self.points, self.edges, self.faces)
        mesh = ipctk.CollisionMesh(rest_positions=vertices, edges=edges, faces=faces)
        mesh.can_collide = ipctk.make_static_obstacle_filter(int((self.owner < self.bodies).sum()))
        near = ipctk.NormalCollisions()
        near.build(mesh=mesh, vertices=vertices, dhat=reach)
        if not len(near):
            return None, 0
        squares = [near[k].compute_distance(near[k].dof(vertices, edges, faces)) for k in range(len(near))]
        k = int(np.argmin(squares))
        ids = [int(i) for i in near[k].vertex_ids(edges, faces) if i >= 0]
        first = 2 if near[k].__class__.__name__.startswith("EdgeEdge") else 1
        one, other = (
            f"{WORDS[len(part)]} {self._numbers(part)} of {self._whose(part[0])}" for part in (ids[:first], ids[first:])
        )
        return {"distance": float(np.sqrt(squares[k])), "one": one, "other": other}, len(near)

    def _numbers(self, vertices: Iterable[int]) -> tuple[int, ...]:
        return tuple(int(self.labels[v]) for v in vertices)

    def _defect(
        self,
        level: int | None,
        does: str,
        apart: Callable[[int, int], int | None],
        pairs: Sequence[tuple[Sequence[int] | np.ndarray, Sequence[int] | np.ndarray]],
    ) -> Defect:
        named = [(self._numbers(a), self._numbers(b)) for a, b in pairs]
        one, other = self._whose(pairs[0][0][0]), self._whose(pairs[0][1][0])
        first, second = named[0]
        other = "itself" if other == one else other
        a, b = pairs[0][0][0], pairs[0][1][0]
        if level is None:
            mend = "repair the shape" if other == "itself" else "move them apart"
        elif other == "itself":
            mend = "give more vertices to coarse levels or repair the shape"
        else:
            free = apart(int(self.owner[a]), int(self.owner[b]))
            mend = MEND if free is None else MEND_LEVEL.format(free=free, level=level)
        depth, (of, when) = self._depth(self.owner[a], self.owner[b]), _where(level)
        error = IntersectionError(
            f"{of}{one} {does} {other} {when}{depth} ({WORDS[len(first)]} {first} and {WORDS[len(second)]}"
            f" {second}, {len(named)} such pairs); {mend}",
            named,
            level or 0,
            *self._apart(self.owner[a], self.owner[b]),
        )
        return Defect(error, [self.points[list(part)] for pair in pairs for part in pair])

    def _depth(self, one: int, other: int) -> str:
        """Where and how deep one of two owners of boundaries reaches furthest into the other, in words."""
        most, words = 0.0, ""
        for inner, outer in ((one, other), (other, one)) if one != other else ():
            if not self.closed[outer]:
                continue
            points, facets = self.points[self.owner == inner], self.facets[self.owner[self.facets[:, 0]] == outer]
            within = points[enclosed(points, self.points, facets)]
            places = nearest_points(self.points, facets, within)[1] if len(within) else within
            depths = np.linalg.norm(within - places, axis=1)
            if depths.max(initial=0.0) > most:
                most, where = depths.max(), places[np.argmax(depths)]
                place = ", ".join(f"{x:.3g}" for x in np.where(np.abs(where) < ROUNDING * most, 0.0, where))
                words = f", by up to {most:.3g} m, from ({place}) into {self.names[outer]}"
        return words

    def _apart(self, one: int, other: int) -> tuple[list[int], np.ndarray | None]:
        """The bodies among two owners of boundaries, and the direction in which the first leaves the other: from centre
        to centre.
        """
        if one == other:
            return [one], None
        bodies = [k for k in (one, other) if k < self.bodies]
        first, second = bodies[0], other if bodies[0] == one else one
        middles = [
            (self.points[self.owner == k].min(axis=0) + self.points[self.owner == k].max(axis=0)) / 2
            for k in (first, second)
        ]
        way, up = middles[0] - middles[1], np.eye(self.points.shape[1])[-1]
        length = np.linalg.norm(way)
        return bodies, way / length if length > 0.0 else up

    def contained(self, level: int | None, apart: Callable[[int, int], int | None]) -> Iterator[Defect]:
        """A body or obstacle that lies wholly inside another one; `apart` as for `crossings`."""
        for outer, inside in self._inside():
            one, (of, when) = int(self.owner[inside[0]]), _where(level)
            free = apart(one, outer)
            hollow = "set closed=False on a hollow obstacle" if outer >= self.bodies else "give the outer one a cavity"
            mend = f"move them apart, or {hollow}" if free is None else MEND_LEVEL.format(free=free, level=level)
            yield Defect(
                IntersectionError(
                    f"{of}{self.names[one]} lies inside {self.names[outer]} {when} (vertex"
                    f" {self.labels[inside[0]]}); {mend}",
                    [(int(self.labels[v]),) for v in inside],
                    level or 0,
                    *self._apart(one, outer),
                ),
                [self.points[[v]] for v in inside],
            )

    def _inside(self) -> Iterator[tuple[int, np.ndarray]]:
        """Owners whose boundaries enclose vertices of others: found by the winding number of a vertex of each shell.
        Gives the owner and these vertices.
        """
        shell = connected_parts(self.facets, len(self.points))
        _, representatives = np.unique(shell, return_index=True)
        facet_owner = self.owner[self.facets[:, 0]]
        for outer in range(len(self.names)):
            if not self.closed[outer]:
                continue
            inner = representatives[self.owner[representatives] != outer]
            if outer >= self.bodies:
                inner = inner[self.owner[inner] < self.bodies]
            mine = self.points[self.owner == outer]
            near = ((self.points[inner] > mine.min(axis=0)) & (self.points[inner] < mine.max(axis=0))).all(axis=1)
            inner = inner[near]
            if len(inner) == 0:
                continue
            inside = inner[enclosed(self.points[inner], self.points, self.facets[facet_owner == outer])]
            if len(inside):
                yield outer, inside
