"""Quadric decimation (Garland and Heckbert 1997) of a closed surface that stays closed, manifold and free of
self-intersections; and the splitting of longest edges of one whose triangles are too large for a level.
"""

import heapq
from collections.abc import Iterator
from itertools import count as counted
from threading import Lock

import igl
import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.level_mesh import connected_parts
from pdvol.meshes import Surface
from pdvol.meshing.cpu_budget import check_budget
from pdvol.meshing.validate import check_surface

MIN_SURFACE_VERTICES = 4
"""Number of vertices of the smallest closed surface, a tetrahedron."""
DIAGONAL = 0.3
"""Size in which fast-simplification works: its limit on a collapse's squared error grows from round to round, from an
absolute length. With `AGGRESSION` it grows slowly enough for cheap collapses to come first, and reaches a third of the
diagonal.
"""
AGGRESSION = 3.5
"""Exponent with which that limit grows; the library's own 7 doubles the distance from the input."""
_SIMPLIFYING = Lock()
"""Held while fast-simplification works: it keeps its mesh in global variables, and levels are made side by side."""
Edge = tuple[int, int]
"""Its smaller vertex first."""


def topology(triangles: np.ndarray, n: int) -> tuple[int, int]:
    """Number of shells and Euler characteristic of a closed surface whose `n` vertices are all used."""
    return int(connected_parts(triangles, n).max()) + 1, n - len(triangles) // 2


def decimate(surface: Surface, target: int, name: str = "surface") -> Surface:
    """The surface with about `target` vertices, its shells and handles kept; unchanged where it has no more than that.

    Several settings and libraries are tried until the result passes `check_surface`. Those that prevent intersections
    are slower and come last. It raises MeshError where no attempt passed.
    """
    n = len(surface.vertices)
    if n <= target:
        return surface
    wanted = topology(surface.triangles, n)
    reason = ""
    for points, triangles in _attempts(surface, max(target, MIN_SURFACE_VERTICES * wanted[0]), wanted[1]):
        check_budget(name)
        try:
            result = check_surface(Surface(points, triangles), name)
        except InputError as error:
            reason = str(error)
            continue
        if topology(result.triangles, len(result.vertices)) == wanted:
            return result
        reason = f"{name}: decimation closed a hole or lost a part"
    raise MeshError(
        f"{reason or name} after decimation to {target} vertices; ask for more vertices or give a cleaner surface"
    )


def _attempts(surface: Surface, target: int, euler: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    import fast_simplification

    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    centre, size = (low + high) / 2.0, float(np.linalg.norm(high - low)) / DIAGONAL
    points = np.ascontiguousarray((surface.vertices - centre) / size, dtype=np.float64)
    triangles = np.ascontiguousarray(surface.triangles, dtype=np.int32)
    for factor, more in ((1.0, 0.0), (1.0, 0.5), (1.1, 1.0), (1.2, -0.5)):
        faces = min(int(2 * (factor * target - euler)), len(triangles))
        with _SIMPLIFYING:
            made = fast_simplification.simplify(points, triangles, target_count=max(faces, 4), agg=AGGRESSION + more)
        yield centre + size * made[0], made[1]
    faces = max(2 * (target - euler), 4)
    for collapse in (igl.qslim, igl.decimate):
        made = collapse(np.asfortranarray(points), np.asfortranarray(triangles), max_m=faces, block_intersections=True)
        yield centre + size * made[0], made[1]


def split_longest_edges(surface: Surface, count: int) -> Surface:
    """The closed surface with `count` vertices: its longest edge is halved, with the two triangles at it, until it has
    so many. Unchanged where it has them already.

    Edges of one length are taken in the order of their vertices, so that the result is always the same.
    """
    if len(surface.vertices) >= count:
        return surface
    points = [np.asarray(p, dtype=np.float64) for p in surface.vertices]
    triangles: dict[int, tuple[int, ...]] = {}
    beside: dict[Edge, set[int]] = {}
    queue, numbers = list[tuple[float, Edge]](), counted()
    # lengths are compared to nine digits: those that differ by round-off alone are equal
    digits = 9 - int(np.floor(np.log10(np.ptp(surface.vertices, axis=0).max())))

    def add(corners: tuple[int, ...]) -> None:
        number = next(numbers)
        triangles[number] = corners
        for edge in _edges(corners):
            if edge not in beside:
                length = float(np.linalg.norm(points[edge[0]] - points[edge[1]]))
                heapq.heappush(queue, (-round(length, digits), edge))
            beside.setdefault(edge, set()).add(number)

    for corners in surface.triangles.tolist():
        add(tuple(corners))
    while len(points) < count:
        _, edge = heapq.heappop(queue)
        middle = len(points)
        points.append(0.5 * (points[edge[0]] + points[edge[1]]))
        for number in sorted(beside[edge]):
            corners = triangles.pop(number)
            for other in _edges(corners):
                beside[other].discard(number)
            k = _edges(corners).index(edge)
            apex, first, second = *corners[k:], *corners[:k]
            add((apex, first, middle))
            add((apex, middle, second))
    return Surface(np.array(points), np.array([triangles[k] for k in sorted(triangles)], dtype=np.int32))


def _edges(corners: tuple[int, ...]) -> list[Edge]:
    """Those opposite to each corner."""
    a, b, c = corners
    return [(min(pair), max(pair)) for pair in ((b, c), (c, a), (a, b))]
