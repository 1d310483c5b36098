"""The size of a shape that turning does not change."""

import numpy as np

from pdvol.geometry.level_mesh import facet_sizes


def gyration_diagonal(points: np.ndarray, facets: np.ndarray) -> float:
    """Diagonal [m] of the box around the sphere (circle in 2D) that has a boundary's radius of gyration. Turning the
    boundary does not change it; it needs neither an orientation nor to be closed.

    Parameters
    ----------
    points : (n, d) [m]
    facets : (m, d) edges in 2D, triangles in 3D
    """
    d = points.shape[1]
    sizes = facet_sizes(points, facets)
    fractions = sizes / sizes.sum()
    corners = points[facets]
    corners = corners - fractions @ corners.mean(axis=1)
    sums = corners.sum(axis=1)
    # Of a facet with corners v_i: the mean of |x|^2 is (sum |v_i|^2 + |sum v_i|^2) / (d (d + 1)).
    squares = np.einsum("kij,kij->k", corners, corners) + np.einsum("kj,kj->k", sums, sums)
    radius = np.sqrt(fractions @ squares / (d * (d + 1)))
    return float(2.0 * np.sqrt(d) * radius)
