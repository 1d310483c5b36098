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
    if len(points) == 0:
        return np.zeros(0)
    queries, places = (np.ascontiguousarray(array, dtype=np.float64) for array in (points, corners))
    faces = np.ascontiguousarray(triangles, dtype=np.int64)
    distance = np.sqrt(np.maximum(igl.point_mesh_squared_distance(queries, places, faces)[0], 0.0))
    inside = np.abs(igl.fast_winding_number(places, faces, queries)) > INSIDE_WINDING
    return np.where(inside, -distance, distance)


def deepest_inside(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> float:
    """[m] how deep the deepest of points (n, 3) lies inside a closed surface; 0 where none does."""
    used = corners[np.unique(triangles)]
    near = ((points >= used.min(axis=0)) & (points <= used.max(axis=0))).all(axis=1)
    return max(0.0, -float(signed_distance(points[near], corners, triangles).min(initial=0.0)))
