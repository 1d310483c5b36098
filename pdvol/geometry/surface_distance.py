"""The distance between two boundaries: how much a coarse level's shape differs from the input's."""

import igl
import numpy as np

SAMPLES = 50_000
"""Points at which a boundary is sampled, at least: about a thousandth of a surface's diagonal apart, three ten
thousandths of an outline's.
"""


def hausdorff_distance(
    points: np.ndarray, facets: np.ndarray, other_points: np.ndarray, other_facets: np.ndarray
) -> float:
    """The two-sided Hausdorff distance [m] between two boundaries: triangles (k, 3) in 3D, edges (k, 2) in 2D.

    The largest distance from a sampled point of either to the nearest point of the other. Corners are sampled, and the
    true distance is larger by less than the distance between samples.
    """
    a, b = (points, facets), (other_points, other_facets)
    return max(_one_sided(*a, *b), _one_sided(*b, *a))


def _one_sided(points: np.ndarray, facets: np.ndarray, other_points: np.ndarray, other_facets: np.ndarray) -> float:
    squares = igl.point_mesh_squared_distance(
        np.ascontiguousarray(_sampled(points, facets), dtype=np.float64),
        np.ascontiguousarray(other_points, dtype=np.float64),
        np.ascontiguousarray(other_facets, dtype=np.int64),
    )[0]
    return float(np.sqrt(np.max(squares)))


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
