"""The distance between two boundaries that do not cross, exact in 2D and 3D: corners to facets, and edges to edges."""

import numpy as np

from pdvol.geometry.distances import distances_to
from pdvol.measure.verify import overlapping_boxes


def surface_gap(points: np.ndarray, facets: np.ndarray, other_points: np.ndarray, other_facets: np.ndarray) -> float:
    """[m] the smallest distance between two boundaries, which do not cross: triangles (k, 3) in 3D, edges (k, 2) in 2D.

    Parameters
    ----------
    points, other_points : (n, d) [m]
    facets, other_facets : (k, d) corners of each facet
    """
    there = distances_to(points[np.unique(facets)], other_points, other_facets)
    back = distances_to(other_points[np.unique(other_facets)], points, facets)
    gap = float(min(there.min(), back.min()))
    if points.shape[1] == 2:
        return gap
    one, other = points[_edges(facets)], other_points[_edges(other_facets)]
    grown = [(ends.min(1) - gap / 2, ends.max(1) + gap / 2) for ends in (one, other)]
    pairs = overlapping_boxes(*grown[0], *grown[1])
    if len(pairs) == 0:
        return gap
    return min(gap, float(segment_gaps(one[pairs[:, 0]], other[pairs[:, 1]]).min()))


def _edges(facets: np.ndarray) -> np.ndarray:
    """(e, 2) int64: each edge of triangles once."""
    return np.unique(np.sort(facets[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)


def segment_gaps(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """(k,) [m]: distances of k pairs of segments (k, 2, d), given by their ends.

    The closest points are at the lines' closest points, moved into both segments in turn (Ericson 2005, section 5.1.9).
    """
    d1, d2, r = one[:, 1] - one[:, 0], other[:, 1] - other[:, 0], one[:, 0] - other[:, 0]
    a, b, e = (np.einsum("kd,kd->k", u, v) for u, v in ((d1, d1), (d1, d2), (d2, d2)))
    c, f = (np.einsum("kd,kd->k", u, r) for u in (d1, d2))
    a, e = np.maximum(a, np.finfo(float).tiny), np.maximum(e, np.finfo(float).tiny)
    denominator = a * e - b * b
    parallel = denominator <= 1e-12 * a * e
    s = np.where(parallel, 0.0, np.clip((b * f - c * e) / np.where(parallel, 1.0, denominator), 0.0, 1.0))
    t = (b * s + f) / e
    s = np.where(t < 0.0, np.clip(-c / a, 0.0, 1.0), np.where(t > 1.0, np.clip((b - c) / a, 0.0, 1.0), s))
    t = np.clip(t, 0.0, 1.0)
    return np.linalg.norm(r + s[:, None] * d1 - t[:, None] * d2, axis=1)
