"""Where what is drawn crosses: contact keeps the simulated surfaces apart, and render meshes stand out from them.

Vertices of a render mesh are tested against what is drawn of everything else: half-spaces, closed obstacles, and of
each other body its closed render meshes or, where it has none, its simulated surface. Where the render mesh is closed
itself, the vertices of the others are tested against it, too. Depths are distances to the crossed surface, at the
stored steps. Two flat faces whose edges alone cross are not found, and a mesh is not tested against itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pdvol.geometry.distances import box_of, deepest_inside, is_closed, signed_distance
from pdvol.store.reader import Run, RunLevel
from pdvol.store.render_meshes import StoredRender


@dataclass(frozen=True)
class RenderCrossing:
    """The deepest crossing of a render mesh.

    Attributes
    ----------
    depth : [m]; 0 where nothing crosses
    name : of the render mesh
    other : what it crosses, as in "plane 'floor'"
    step : when
    """

    depth: float
    name: str = ""
    other: str = ""
    step: int = 0


@dataclass(frozen=True, eq=False)
class _Drawn:
    """A surface that is drawn at a step; `body` is -1 of an obstacle, `used` are the vertices of its triangles."""

    name: str
    body: int
    points: np.ndarray
    triangles: np.ndarray
    used: np.ndarray
    closed: bool
    is_render: bool = False


def rest_gaps(level: RunLevel, mesh: StoredRender) -> tuple[float, float]:
    """[m] how far a render mesh at rest stands out from its body's simulated surface, and how deep it lies within."""
    facets = _facets(level, mesh.body)
    gaps = signed_distance(mesh.points[np.unique(mesh.welded)], level.rest, facets)
    return max(0.0, float(gaps.max())), max(0.0, -float(gaps.min()))


def deepest_crossing(run: Run, level: RunLevel) -> RenderCrossing:
    """The deepest crossing of a run's render meshes over all steps of a level; the first of several alike."""
    closed = [is_closed(mesh.welded) for mesh in run.render_meshes]
    obstacles = [o.kind == "mesh" and is_closed(o.arrays["faces"]) for o in run.obstacles]
    worst = RenderCrossing(0.0)
    for step in range(level.steps):
        drawn = list(_drawn(run, level, step, closed, obstacles))
        for mesh in drawn:
            if not mesh.is_render:
                continue
            for label, depth in _crossings(run, level, step, mesh, drawn):
                if depth > worst.depth:
                    worst = RenderCrossing(depth, mesh.name, label, step)
    return worst


def _drawn(run: Run, level: RunLevel, step: int, closed: list[bool], obstacles: list[bool]) -> Iterator[_Drawn]:
    x = level.positions(step)
    for mesh, whole in zip(run.render_meshes, closed, strict=True):
        points = level.render_weights(mesh) @ x
        # Corners of seams are one vertex here: an open seam would let the inside out.
        yield _Drawn(mesh.name, mesh.body, points, mesh.welded, np.unique(mesh.welded), whole, True)
    covered = {mesh.body for mesh, whole in zip(run.render_meshes, closed, strict=True) if whole}
    for body, name in enumerate(run.info["bodies"]):
        if body not in covered:
            facets = _facets(level, body)
            yield _Drawn(name, body, x, facets, np.unique(facets), True)
    for obstacle, whole in zip(level.placed(run.obstacles, step), obstacles, strict=True):
        if obstacle.kind == "mesh":
            faces = np.asarray(obstacle.arrays["faces"])
            yield _Drawn(obstacle.name, -1, obstacle.vertices(step), faces, np.unique(faces), whole)


def _crossings(run: Run, level: RunLevel, step: int, mesh: _Drawn, drawn: list[_Drawn]) -> Iterator[tuple[str, float]]:
    """What a render mesh may cross at a step, and how deep it does [m]."""
    vertices = mesh.points[mesh.used]
    for obstacle in level.placed(run.obstacles, step):
        if obstacle.kind == "plane":
            point, normal = obstacle.plane(step)
            yield f"plane {obstacle.name!r}", max(0.0, -float(((vertices - point) @ normal).min()))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    for number, other in enumerate(drawn):
        first_of_two = other.is_render and number <= next(i for i, one in enumerate(drawn) if one is mesh)
        if other.body == mesh.body or first_of_two:  # of two render meshes each is tested against the other once
            continue
        box = box_of(other.points, other.triangles)
        if (box[0] > high).any() or (box[1] < low).any():
            continue
        depth = deepest_inside(vertices, other.points, other.triangles) if other.closed else 0.0
        if mesh.closed:
            depth = max(depth, deepest_inside(other.points[other.used], mesh.points, mesh.triangles))
        yield f"{'obstacle' if other.body < 0 else 'body'} {other.name!r}", depth


def _facets(level: RunLevel, body: int) -> np.ndarray:
    return level.surface[level.mesh.point_bodies[level.surface[:, 0]] == body]
