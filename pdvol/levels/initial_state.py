"""Intersections of bodies with themselves, each other, obstacles and planes: the state every level starts from must be
free of them.

Written apart from the solver's contact code. Separately decimated surfaces can cross where the originals do not, so
every level is tested.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import igl
import numpy as np

from pdvol.errors import InputError, IntersectionError
from pdvol.geometry.crossings import edges_of, find_crossings, find_touching, fortran
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.meshing.validate import shells
from pdvol.scene import Plane, Rigid, Scene, moved

Obstacle = tuple[np.ndarray, np.ndarray, np.ndarray]
WORDS = {1: "vertex", 2: "edge", 3: "triangle"}
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
        Names the level, the two parties and example primitives; `pairs` has all of them. Edges are given by their
        vertices, triangles by their vertices, numbered as in the level's mesh or in the obstacle.
    InputError
        An obstacle's dimension is not the bodies'.
    """
    if not scene.contact:
        return  # nothing keeps bodies apart later either
    for level, mesh in enumerate(level_meshes):
        for defect in find_defects(level, mesh, obstacles, scene):
            raise defect.error


@dataclass(frozen=True, eq=False)
class Defect:
    """Something that crosses, touches or contains another at t = 0.

    Attributes
    ----------
    error : what there is to raise: what, where, the mend
    primitives : (k, d) corners [m] of each primitive, two for each pair where two are involved
    """

    error: IntersectionError
    primitives: list[np.ndarray]


@dataclass(frozen=True)
class Gap:
    """The nearest two primitives: distance [m], and both in words."""

    distance: float
    one: str
    other: str


def find_defects(level: int, mesh: LevelMesh, obstacles: Sequence[Obstacle], scene: Scene) -> Iterator[Defect]:
    """The errors of one level at t = 0, found one after the other; arguments and InputError as `check_start`."""
    for plane in scene.obstacles:
        if isinstance(plane, Plane):
            yield from _below(level, mesh, plane, scene)
    parties = _Parties(mesh, obstacles, scene)
    crossings = list(parties.crossings(level))
    yield from crossings or parties.contained(level)  # what crosses may well lie inside, too


def smallest_gap(mesh: LevelMesh, obstacles: Sequence[Obstacle], scene: Scene, reach: float) -> tuple[Gap | None, int]:
    """The smallest gap at t = 0 up to `reach` [m], if there is one, and how many pairs of primitives are that near.
    Nothing may cross.
    """
    gap, count = _Parties(mesh, obstacles, scene).gap(reach)
    for plane in scene.obstacles:
        if isinstance(plane, Plane):
            height = _heights(mesh.points, plane)
            nearest = int(np.argmin(height))
            count += int((height < reach).sum())
            if height[nearest] < (reach if gap is None else gap.distance):
                gap = Gap(
                    float(height[nearest]),
                    f"vertex {nearest} of body {scene.bodies[mesh.point_bodies[nearest]].name!r}",
                    f"plane {plane.name!r}",
                )
    return gap, count


def count_intersections(
    mesh: LevelMesh, positions: np.ndarray, obstacles: Sequence[Obstacle], scene: Scene, time: float
) -> int:
    """How much crosses in a state that nothing kept apart: pairs of edges (2D) or of edges and triangles (3D), and
    vertices at or below planes. Serial.

    Parameters
    ----------
    positions : (n, d) [m]
    obstacles : as `check_start` takes them
    time : [s], which says where obstacles are
    """
    behind = sum(
        int(np.sum(_heights(positions, plane, time) <= 0.0)) for plane in scene.obstacles if isinstance(plane, Plane)
    )
    return behind + len(_Parties(mesh, obstacles, scene, positions, time).crossing_pairs())


def _heights(points: np.ndarray, plane: Plane, time: float = 0.0) -> np.ndarray:
    """(n,) heights [m] of points (n, d) above a plane at a time."""
    dim = points.shape[1]
    if len(plane.point) != dim:
        raise InputError(f"plane {plane.name!r} is {len(plane.point)}D in a {dim}D scene; give {dim} components")
    ends = _ends(plane, time)
    return (points - ends[0]) @ (ends[1] - ends[0])


def _ends(plane: Plane, time: float = 0.0) -> np.ndarray:
    """A plane's point and the end of its unit normal there, at a time."""
    point, normal = np.asarray(plane.point, dtype=float), np.asarray(plane.normal, dtype=float)
    return moved(
        plane.motion, np.stack([point, point + normal / np.linalg.norm(normal)]), time, f"plane {plane.name!r}"
    )


def _below(level: int, mesh: LevelMesh, plane: Plane, scene: Scene) -> Iterator[Defect]:
    height = _heights(mesh.points, plane)
    below = np.flatnonzero(height <= 0.0)
    if len(below):
        worst = int(np.argmin(height))
        body = scene.bodies[mesh.point_bodies[worst]].name
        many = f"{len(below)} vertices are" if len(below) > 1 else "1 vertex is"
        ends = _ends(plane)
        yield Defect(
            IntersectionError(
                f"level {level}: {many} at or below plane {plane.name!r} at t = 0, the worst vertex {worst} of body"
                f" {body!r} by {-height[worst]:.3g} m; lift the body or lower the plane",
                [(int(v),) for v in below],
                level,
                (mesh.point_bodies[worst],),
                ends[1] - ends[0],
            ),
            [mesh.points[[v]] for v in below],
        )


class _Parties:
    """All boundaries of one level, at rest or at positions (n, d), in one set of arrays: bodies first (owner >= 0),
    then obstacles, where they are at a time.
    """

    def __init__(
        self,
        mesh: LevelMesh,
        obstacles: Sequence[Obstacle],
        scene: Scene,
        positions: np.ndarray | None = None,
        time: float = 0.0,
    ):
        rigids = [o for o in scene.obstacles if isinstance(o, Rigid)]
        if len(rigids) != len(obstacles):
            raise InputError(f"{len(obstacles)} obstacle meshes for {len(rigids)} rigid obstacles; read one for each")
        positions = mesh.points if positions is None else positions
        self.names = [f"body {b.name!r}" for b in scene.bodies] + [f"obstacle {r.name!r}" for r in rigids]
        self.closed = [True] * len(scene.bodies) + [r.closed for r in rigids]
        self.bodies = len(scene.bodies)
        facets = [mesh.boundary]
        # Inner points of a body cannot cross anything before its boundary does.
        used = np.unique(mesh.boundary)
        points, owners, first = [positions[used]], [mesh.point_bodies[used]], len(used)
        number = np.full(len(mesh.points), -1, dtype=np.int64)
        number[used] = np.arange(len(used))
        facets, labels = [number[mesh.boundary]], [used]
        for k, ((vertices, edges, faces), rigid) in enumerate(zip(obstacles, rigids, strict=True)):
            if vertices.shape[1] != mesh.dim:
                raise InputError(
                    f"obstacle {rigid.name!r} is {vertices.shape[1]}D in a {mesh.dim}D scene; give it {mesh.dim}"
                    " dimensions"
                )
            points.append(moved(rigid.motion, vertices, time, f"obstacle {rigid.name!r}"))
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

    def crossing_pairs(self) -> np.ndarray:
        """As `find_crossings` gives them."""
        return find_crossings(self.points, self.edges, self.faces, np.where(self.owner >= self.bodies, -1, 0))

    def crossings(self, level: int) -> Iterator[Defect]:
        """Boundaries that cross, or else touch."""
        obstacle = np.where(self.owner >= self.bodies, -1, 0)
        second = self.edges if len(self.faces) == 0 else self.faces
        pairs = self.crossing_pairs()
        if len(pairs):
            yield self._defect(level, "crosses", [(self.edges[a], second[b]) for a, b in pairs])
            return
        touching = find_touching(self.points, self.edges, self.faces, obstacle)
        if len(touching):
            yield self._defect(level, "touches", [([a], [b]) for a, b in touching])

    def gap(self, reach: float) -> tuple[Gap | None, int]:
        """The nearest two primitives up to `reach` [m], and how many pairs are that near."""
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
        return Gap(float(np.sqrt(squares[k])), one, other), len(near)

    def _numbers(self, vertices) -> tuple[int, ...]:
        return tuple(int(self.labels[v]) for v in vertices)

    def _defect(self, level: int, does: str, pairs) -> Defect:
        named = [(self._numbers(a), self._numbers(b)) for a, b in pairs]
        one, other = self._whose(pairs[0][0][0]), self._whose(pairs[0][1][0])
        first, second = named[0]
        other = "itself" if other == one else other
        mend = "give more vertices to coarse levels or repair the shape" if other == "itself" else MEND
        a, b = pairs[0][0][0], pairs[0][1][0]
        error = IntersectionError(
            f"level {level}: {one} {does} {other} at t = 0 ({WORDS[len(first)]} {first} and {WORDS[len(second)]}"
            f" {second}, {len(named)} such pairs); {mend}",
            named,
            level,
            *self._apart(self.owner[a], self.owner[b]),
        )
        return Defect(error, [self.points[list(part)] for pair in pairs for part in pair])

    def _apart(self, one: int, other: int) -> tuple[list[int], np.ndarray | None]:
        """The bodies of two parties, and the direction in which the first leaves the other: from centre to centre."""
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

    def contained(self, level: int) -> Iterator[Defect]:
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
                yield Defect(
                    IntersectionError(
                        f"level {level}: {self._whose(inside[0])} lies inside {self.names[outer]} at t = 0 (vertex"
                        f" {self.labels[inside[0]]}); move them apart, or set closed=False on a hollow obstacle",
                        [(int(self.labels[v]),) for v in inside],
                        level,
                        *self._apart(self.owner[inside[0]], outer),
                    ),
                    [self.points[[v]] for v in inside],
                )
