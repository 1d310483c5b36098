"""How far points lie outside of a closed surface, or inside it."""

import igl
import numpy as np

from pdvol.geometry.crossings import counted_edges

INSIDE_WINDING = 0.5
"""Winding number, whatever its sign, above which a point counts as inside: 0 outside of a closed surface, 1 inside."""


def is_closed(triangles: np.ndarray) -> bool:
    """Whether triangles (k, 3) enclose a volume: each edge has an even number of them."""
    return len(triangles) > 0 and bool((counted_edges(triangles)[2] % 2 == 0).all())


def signed_distance(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) [m]: the distance of points (n, 3) from a closed surface of triangles (k, 3), below zero inside it.

    Which way its triangles point does not count. The sign comes from winding numbers (Barill et al. 2018), the distance
    is that of the nearest triangle.
    """
    distance = _distance(points, corners, triangles)
    return np.where(_inside(points, corners, triangles), -distance, distance)


def deepest_inside(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> float:
    """[m] how deep the deepest of points (n, 3) lies inside a closed surface; 0 where none does."""
    low, high = box_of(corners, triangles)
    near = points[((points >= low) & (points <= high)).all(axis=1)]
    if len(near) == 0:
        return 0.0
    inside = near[_inside(near, corners, triangles)]
    return float(_distance(inside, corners, triangles).max(initial=0.0))


def box_of(corners: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and highest coordinates (3,) of a surface."""
    used = corners[triangles.ravel()]
    return used.min(axis=0), used.max(axis=0)


def _distance(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    if len(points) == 0:
        return np.zeros(0)
    squares = igl.point_mesh_squared_distance(*_for_igl(points, corners, triangles))[0]
    return np.sqrt(np.maximum(np.atleast_1d(squares), 0.0))


def _inside(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    queries, places, faces = _for_igl(points, corners, triangles)
    return np.abs(np.atleast_1d(igl.fast_winding_number(places, faces, queries))) > INSIDE_WINDING


def _for_igl(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, ...]:
    queries, places = (np.ascontiguousarray(array, dtype=np.float64) for array in (points, corners))
    return queries, places, np.ascontiguousarray(triangles, dtype=np.int64)
