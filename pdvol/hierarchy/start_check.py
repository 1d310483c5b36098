"""The state every level starts from must be free of intersections: bodies with themselves, each other, obstacles and planes.

Written apart from the solver's contact code. Separately decimated surfaces can cross where the originals do not, so every level is tested.
"""

from collections.abc import Sequence

import igl
import numpy as np

from pdvol.errors import InputError, IntersectionError
from pdvol.hierarchy.crossings import edges_of, find_crossings, find_touching
from pdvol.hierarchy.level_mesh import LevelMesh
from pdvol.hierarchy.validate import shells
from pdvol.scene import Plane, Rigid, Scene, moved

Obstacle = tuple[np.ndarray, np.ndarray, np.ndarray]
MEND = "move them apart, or give more vertices to coarse levels"


def check_start(level_meshes: Sequence[LevelMesh], obstacles: Sequence[Obstacle], scene: Scene) -> None:
    """Raise unless every level of a scene with contact is free of intersections at t = 0. Serial.

    Parameters
    ----------
    level_meshes : the levels, coarsest first
    obstacles : vertices, edges and faces (`build.read_obstacle`) of each `Rigid` of the scene, in its order
    scene : Scene

    Raises
    ------
    IntersectionError
        Names the level, the two parties and example primitives; `pairs` has all of them. Edges are given by their vertices, triangles
        by their vertices, numbered as in the level's mesh or in the obstacle.
    InputError
        An obstacle's dimension is not the bodies'.
    """
    if not scene.contact:
        return  # nothing keeps bodies apart later either
    rigids = [o for o in scene.obstacles if isinstance(o, Rigid)]
    if len(rigids) != len(obstacles):
        raise InputError(f"{len(obstacles)} obstacle meshes for {len(rigids)} rigid obstacles; read one for each")
    for level, mesh in enumerate(level_meshes):
        for plane in scene.obstacles:
            if isinstance(plane, Plane):
                _check_plane(level, mesh, plane, scene)
        parties = _Parties(mesh, obstacles, rigids, scene)
        parties.check_crossings(level)
        parties.check_containment(level)


def _check_plane(level: int, mesh: LevelMesh, plane: Plane, scene: Scene) -> None:
    if len(plane.point) != mesh.dim:
        raise InputError(f"plane {plane.name!r} is {len(plane.point)}D in a {mesh.dim}D scene; give {mesh.dim} components")
    point, normal = np.asarray(plane.point, dtype=float), np.asarray(plane.normal, dtype=float)
    ends = moved(plane.motion, np.stack([point, point + normal / np.linalg.norm(normal)]), 0.0, f"plane {plane.name!r}")
    height = (mesh.points - ends[0]) @ (ends[1] - ends[0])
    below = np.flatnonzero(height <= 0.0)
    if len(below):
        worst = int(np.argmin(height))
        body = scene.bodies[mesh.point_bodies[worst]].name
        many = f"{len(below)} vertices are" if len(below) > 1 else "1 vertex is"
        raise IntersectionError(
            f"level {level}: {many} at or below plane {plane.name!r} at t = 0, the worst vertex {worst} of body {body!r} by "
            f"{-height[worst]:.3g} m; lift the body or lower the plane",
            [(int(v),) for v in below], level, (mesh.point_bodies[worst],), moved[1] - moved[0],
        )


class _Parties:
    """All boundaries of one level in one set of arrays: bodies first (owner >= 0), then obstacles (owner < 0)."""

    def __init__(self, mesh: LevelMesh, obstacles: Sequence[Obstacle], rigids: Sequence[Rigid], scene: Scene):
        self.names = [f"body {b.name!r}" for b in scene.bodies] + [f"obstacle {r.name!r}" for r in rigids]
        self.closed = [True] * len(scene.bodies) + [r.closed for r in rigids]
        self.bodies = len(scene.bodies)
        facets = [mesh.boundary]
        # Inner points of a body cannot cross anything before its boundary does.
        used = np.unique(mesh.boundary)
        points, owners, first = [mesh.points[used]], [mesh.point_bodies[used]], len(used)
        number = np.full(len(mesh.points), -1, dtype=np.int64)
        number[used] = np.arange(len(used))
        facets, labels = [number[mesh.boundary]], [used]
        for k, ((vertices, edges, faces), rigid) in enumerate(zip(obstacles, rigids, strict=True)):
            if vertices.shape[1] != mesh.dim:
                raise InputError(f"obstacle {rigid.name!r} is {vertices.shape[1]}D in a {mesh.dim}D scene; give it {mesh.dim} dimensions")
            points.append(moved(rigid.motion, vertices, 0.0, f"obstacle {rigid.name!r}"))
            owners.append(np.full(len(vertices), self.bodies + k))
            facets.append((faces if mesh.dim == 3 else edges) + first)
            labels.append(np.arange(len(vertices)))
            first += len(vertices)
        self.points, self.owner, self.labels = np.vstack(points), np.concatenate(owners), np.concatenate(labels)
        self.facets = np.vstack(facets).astype(np.int64)
        self.edges = edges_of(self.facets)
        self.faces = self.facets if mesh.dim == 3 else np.empty((0, 3), dtype=np.int64)

    def _whose(self, vertex: int) -> str:
        return self.names[self.owner[vertex]]

    def check_crossings(self, level: int) -> None:
        obstacle = np.where(self.owner >= self.bodies, -1, 0)
        second = self.edges if len(self.faces) == 0 else self.faces
        pairs = find_crossings(self.points, self.edges, self.faces, obstacle)
        if len(pairs):
            named = [(self._numbers(self.edges[a]), self._numbers(second[b])) for a, b in pairs]
            self._raise(level, self.edges[pairs[0, 0], 0], second[pairs[0, 1], 0], "crosses", named)
        touching = find_touching(self.points, self.edges, self.faces, obstacle)
        if len(touching):
            named = [(self._numbers([a]), self._numbers([b])) for a, b in touching]
            self._raise(level, *touching[0], "touches", named)

    def _numbers(self, vertices) -> tuple[int, ...]:
        return tuple(int(self.labels[v]) for v in vertices)

    def _raise(self, level: int, a: int, b: int, does: str, named) -> None:
        one, other = self._whose(a), self._whose(b)
        word = {1: "vertex", 2: "edge", 3: "triangle"}
        first, second = named[0]
        other = "itself" if other == one else other
        mend = "give more vertices to coarse levels or repair the shape" if other == "itself" else MEND
        raise IntersectionError(
            f"level {level}: {one} {does} {other} at t = 0 ({word[len(first)]} {first} and {word[len(second)]} {second}, {len(named)} such "
            f"pairs); {mend}",
            named, level, *self._apart(self.owner[a], self.owner[b]),
        )

    def _apart(self, one: int, other: int) -> tuple[list[int], np.ndarray | None]:
        """The bodies of two parties, and the way along which the first of them leaves the other: from centre to centre."""
        if one == other:
            return [one], None
        bodies = [k for k in (one, other) if k < self.bodies]
        first, second = bodies[0], other if bodies[0] == one else one
        middles = [(self.points[self.owner == k].min(axis=0) + self.points[self.owner == k].max(axis=0)) / 2 for k in (first, second)]
        way, up = middles[0] - middles[1], np.eye(self.points.shape[1])[-1]
        length = np.linalg.norm(way)
        return bodies, way / length if length > 0.0 else up

    def check_containment(self, level: int) -> None:
        """One party wholly inside another crosses nothing: the winding number of a vertex of each shell tells."""
        shell = shells(self.facets, len(self.points))
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
            facets = np.ascontiguousarray(self.facets[facet_owner == outer])
            winding = igl.winding_number(self.points, facets, np.ascontiguousarray(self.points[inner]))
            inside = inner[np.abs(winding) > 0.5]
            if len(inside):
                raise IntersectionError(
                    f"level {level}: {self._whose(inside[0])} lies inside {self.names[outer]} at t = 0 (vertex {self.labels[inside[0]]}); "
                    "move them apart, or set closed=False on a hollow obstacle",
                    [(int(self.labels[v]),) for v in inside], level, *self._apart(self.owner[inside[0]], outer),
                )
