"""Distances between points and boundaries: triangles (k, 3) in 3D, edges (k, 2) in 2D."""

import igl
import numpy as np

from pdvol.geometry.closed_surfaces import connected_facets, enclosed_volume
from pdvol.geometry.crossings import counted_edges

INSIDE_WINDING = 0.5
"""Winding number, whatever its sign, above which a point counts as inside: 0 outside of a closed surface, 1 inside."""
SAMPLES = 50_000
"""Points at which a boundary is sampled, at least: about 1e-3 of a surface's diagonal apart, 3e-4 of an outline's."""


def distances_to(points: np.ndarray, corners: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(n,) [m]: the distance of points (n, d) from the nearest of the facets (k, d) between `corners` (m, d)."""
    if len(points) == 0:
        return np.zeros(0)
    squares = igl.point_mesh_squared_distance(*_for_igl(points, corners, facets))[0]
    return np.sqrt(np.maximum(np.atleast_1d(squares), 0.0))


def is_closed(triangles: np.ndarray) -> bool:
    """Whether triangles (k, 3) enclose a volume: each edge has an even number of them."""
    return len(triangles) > 0 and bool((counted_edges(triangles)[2] % 2 == 0).all())


def signed_distance(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(n,) [m]: the distance of points (n, 3) from a closed surface of triangles (k, 3), below zero inside it.

    Which way its triangles point does not count. The sign comes from winding numbers (Barill et al. 2018), the distance
    is that of the nearest triangle.
    """
    distance = distances_to(points, corners, triangles)
    return np.where(_inside(points, corners, triangles), -distance, distance)


def deepest_inside(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> float:
    """[m] how deep the deepest of points (n, 3) lies inside a closed surface; 0 where none does."""
    low, high = box_of(corners, triangles)
    near = points[((points >= low) & (points <= high)).all(axis=1)]
    if len(near) == 0:
        return 0.0
    return float(distances_to(near[_inside(near, corners, triangles)], corners, triangles).max(initial=0.0))


def hausdorff_distance(
    points: np.ndarray, facets: np.ndarray, other_points: np.ndarray, other_facets: np.ndarray
) -> float:
    """The two-sided Hausdorff distance [m] between two boundaries: triangles (k, 3) in 3D, edges (k, 2) in 2D.

    The largest distance from a sampled point of either to the nearest point of the other. Corners are sampled, and the
    true distance is larger by less than the distance between samples.
    """
    there = distances_to(_sampled(points, facets), other_points, other_facets)
    back = distances_to(_sampled(other_points, other_facets), points, facets)
    return float(max(there.max(), back.max()))


def deviation(
    points: np.ndarray, triangles: np.ndarray, made_points: np.ndarray, made_triangles: np.ndarray
) -> tuple[float, float]:
    """How far [m] a surface lies outside of one that was made of it, and how far that one lies from the surface, by
    samples of both. Outside is what the outward shells of the new one do not enclose: cavities count as inside.
    """
    given, part = _sampled(points, triangles), connected_facets(made_triangles)
    shells = [made_triangles[part == number] for number in np.unique(part)]
    outer = [shell for shell in shells if enclosed_volume(made_points, shell) > 0.0]
    out = ~_inside(given, made_points, np.concatenate(outer or shells))
    lost = distances_to(given[out], made_points, made_triangles)
    return float(lost.max(initial=0.0)), float(
        distances_to(_sampled(made_points, made_triangles), points, triangles).max()
    )


def box_of(corners: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The lowest and highest coordinates (3,) of a surface."""
    used = corners[triangles.ravel()]
    return used.min(axis=0), used.max(axis=0)


def _inside(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    queries, places, faces = _for_igl(points, corners, triangles)
    return np.abs(np.atleast_1d(igl.fast_winding_number(places, faces, queries))) > INSIDE_WINDING


def _for_igl(points: np.ndarray, corners: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, ...]:
    queries, places = (np.ascontiguousarray(array, dtype=np.float64) for array in (points, corners))
    return queries, places, np.ascontiguousarray(triangles, dtype=np.int64)


def _sampled(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Points on a grid of barycentric coordinates in every facet, its corners among them."""
    corners = facets.shape[1]
    parts = 1  # per edge
    while len(facets) * (parts if corners == 2 else parts**2 / 2) < SAMPLES:
        parts += 1
    i = np.arange(parts + 1)
    if corners == 2:
        weights = np.column_stack([i, parts - i]) / parts
    else:
        first, second = (w.ravel() for w in np.meshgrid(i, i, indexing="ij"))
        inside = first + second <= parts
        weights = np.column_stack([first, second, parts - first - second])[inside] / parts
    return np.einsum("wc,fcd->wfd", weights, points[facets]).reshape(-1, points.shape[1])
