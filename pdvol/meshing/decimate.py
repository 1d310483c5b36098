"""Quadric decimation (Garland and Heckbert 1997) of a closed surface that stays closed, manifold and free of
self-intersections.
"""

from collections.abc import Iterator
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
