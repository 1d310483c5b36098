"""Triangles inside closed loops, with a given number of vertices. Each level's boundary is as coarse as its inside."""

import igl
import numpy as np

from pdvol.errors import IntersectionError, MeshError
from pdvol.geometry.crossings import find_crossings
from pdvol.geometry.flat_faces import FlatFaces
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshing.child_process import in_child
from pdvol.meshing.edge_length import (
    BASE_CPU_SECONDS,
    CPU_SECONDS_PER_VERTEX,
    SizedMesh,
    edge_length,
    mesh_of_target_size,
)
from pdvol.meshing.meshers import gmsh_triangles
from pdvol.meshing.validate import drop_unused, outline_edges, signed_area
from pdvol.meshing.volume import with_volume

CORNER_ANGLE = np.pi / 4.0
"""Angle [rad] between segments above which their vertex is a corner of the shape and stays on every level."""
COLLINEAR_TOLERANCE = 0.1
"""Distance from a straight line, relative to the edge length, below which vertices of the outline are left out."""


def triangulate(loops: list[np.ndarray], target: int, name: str = "outline") -> SizedMesh:
    """A triangle mesh of about `target` vertices (see `edge_length`) with the area of the loops; `name` begins
    messages.

    `loops` are closed polygons (k, 2) float64 [m] that do not cross, the first point not repeated: anticlockwise around
    material, clockwise around holes. It raises MeshError where no mesh was found within `MAX_ATTEMPTS`.
    """
    content = sum(signed_area(loop) for loop in loops)
    boundary = sum(float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum()) for loop in loops)
    if content <= 0:
        raise MeshError(f"{name}: the loops enclose no area; outer ones must run anticlockwise")
    h = edge_length(target, content, boundary, 2)
    parents = _parents(loops, name)
    flat = FlatFaces(*polygons(loops))
    cpu_seconds = BASE_CPU_SECONDS + CPU_SECONDS_PER_VERTEX * target

    def make(scale: float, failures: int) -> SizedMesh:
        sampled = _resampled(loops, scale * h * 0.8**failures, name)
        starts = np.cumsum([0, *(len(loop) for loop in sampled)])
        given = np.concatenate(sampled), starts, parents, scale * h
        points, cells = drop_unused(*in_child("Gmsh", gmsh_triangles, *given, cpu_seconds=cpu_seconds))
        negative = simplex_volumes(points, cells) < 0
        cells[negative] = cells[negative][:, [1, 0, 2]]
        for moved in with_volume(points, cells, content, flat):
            if simplex_volumes(moved, cells).min() > 0.0 and not len(_crossings(moved, boundary_facets(cells)[0])):
                return SizedMesh(moved, cells, points)
        raise MeshError(f"{name}: a mesh of {len(points)} vertices crosses itself; ask for more vertices")

    return mesh_of_target_size(make, target, name, 1.0, 2)


def _crossings(points: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Pairs (k, 2) of edges that cross."""
    return find_crossings(points, edges, np.empty((0, 3), dtype=np.int64))


def boundary_loops(points: np.ndarray, edges: np.ndarray, name: str) -> list[np.ndarray]:
    """The closed polygons (k, 2) that a mesh's directed boundary edges (e, 2) form. It raises MeshError where loops
    meet in a vertex, and IntersectionError where they cross.
    """
    if len(np.unique(edges[:, 0])) < len(edges):
        raise MeshError(f"{name}: it meets itself in a vertex; split the mesh there")
    pairs = _crossings(points, edges)
    if len(pairs):
        a, b = (tuple(int(v) for v in edges[k]) for k in pairs[0])
        raise IntersectionError(
            f"{name}: edges {a} and {b} cross; untangle the mesh",
            pairs.tolist(),
            corners=list(points[edges[pairs.ravel()]]),
        )
    following = {int(a): int(b) for a, b in edges}
    loops = []
    while following:
        start, after = following.popitem()
        loop = [start]
        while after != start:
            loop.append(after)
            after = following.pop(after)
        loops.append(points[loop])
    return sorted(loops, key=lambda loop: loop.min(axis=0).tolist())


def resample(loop: np.ndarray, h: float) -> np.ndarray:
    """The closed polygon with segments of about `h` [m] that keep its corners and whose other points lie on it."""
    n = len(loop)
    # Start at the point farthest from the middle: it is on the hull, so the simplified loop keeps it at no cost.
    loop = np.roll(loop, -int(np.argmax(((loop - loop.mean(axis=0)) ** 2).sum(axis=1))), axis=0)
    closed = np.vstack([loop, loop[:1]])
    half = int(np.argmax(((loop - loop[0]) ** 2).sum(axis=1)))
    kept = np.unique(np.concatenate([_simplified(closed[: half + 1], h), half + _simplified(closed[half:], h)]))[:-1]
    ahead = np.roll(loop[kept], -1, axis=0) - loop[kept]
    behind = np.roll(ahead, 1, axis=0)
    turn = np.arctan2(behind[:, 0] * ahead[:, 1] - behind[:, 1] * ahead[:, 0], (behind * ahead).sum(axis=1))
    corners = kept[np.abs(turn) > CORNER_ANGLE]
    least = 1 if len(corners) > 2 else 3
    if len(corners) == 0:
        corners, least = np.array([0]), 6
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    ends = np.concatenate([along[corners], [along[corners[0]] + along[-1]]])
    where = [
        np.linspace(a, b, max(least, round((b - a) / h)), endpoint=False)
        for a, b in zip(ends[:-1], ends[1:], strict=True)
    ]
    where = np.concatenate(where) % along[n]
    return np.column_stack([np.interp(where, along, closed[:, k]) for k in range(2)])


def _simplified(curve: np.ndarray, h: float) -> np.ndarray:
    """Indices of the points that a polyline keeps within `COLLINEAR_TOLERANCE` edge lengths."""
    if len(curve) < 3:
        return np.arange(len(curve))
    kept = igl.ramer_douglas_peucker(np.ascontiguousarray(curve), COLLINEAR_TOLERANCE * h)[1]
    return np.asarray(kept, dtype=np.int64)


def _resampled(loops: list[np.ndarray], h: float, name: str) -> list[np.ndarray]:
    """All loops at edge length `h`, finer where coarse ones would cross."""
    for _ in range(8):
        sampled = [resample(loop, h) for loop in loops]
        if not len(_crossings(*polygons(sampled))):
            return sampled
        h *= 0.5
    raise IntersectionError(f"{name}: the outline crosses itself when coarsened; ask for more vertices")


def polygons(loops: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 2) [m] and edges (n, 2) of closed polygons (k, 2)."""
    starts = np.cumsum([0, *(len(loop) for loop in loops)])
    edges = np.vstack([start + outline_edges(len(loop), True) for start, loop in zip(starts, loops, strict=False)])
    return np.concatenate(loops), edges


def _parents(loops: list[np.ndarray], name: str) -> np.ndarray:
    """-1 for each outer loop; for a hole the smallest outer loop around it."""
    areas = np.array([signed_area(loop) for loop in loops])
    parents = np.full(len(loops), -1)
    for hole in np.flatnonzero(areas < 0):
        place = np.ascontiguousarray(loops[hole][:1])
        turns = {k: igl.winding_number(*polygons([loops[k]]), place)[0] for k in np.flatnonzero(areas > 0)}
        around = [k for k, number in turns.items() if number > 0.5]
        if not around:
            raise MeshError(f"{name}: loop {hole} is a hole outside of everything; reverse it")
        parents[hole] = min(around, key=lambda k: areas[k])
    return parents
