"""Boundaries: what closed ones enclose, which of them are cavities, and a size of all that turning does not change."""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh, connected_parts, facet_sizes


def enclosed_volume(points: np.ndarray, facets: np.ndarray) -> float:
    """Volume [m^3] inside outward triangles (k, 3), area [m^2] inside edges (k, 2) with the inside on their left;
    negative where they point inward.
    """
    centred = points - points[facets].mean(axis=(0, 1))
    # A polynomial of degree d without other terms: the gradient's product with the points is d times its value.
    return float((volume_gradient(centred, facets) * centred).sum()) / points.shape[1]


def volume_gradient(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(n, d) derivative of the volume inside outward facets (k, d) with respect to each vertex."""
    corners = points[facets]
    if points.shape[1] == 2:
        along = corners[:, 1] - corners[:, 0]
        outward = np.column_stack([along[:, 1], -along[:, 0]]) / 2.0
    else:
        outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 6.0
    gradient = np.zeros_like(points)
    for corner in facets.T:
        np.add.at(gradient, corner, outward)
    return gradient


def pressed_facets(mesh: LevelMesh, body: int) -> np.ndarray:
    """(k, d) int64: the facets around what can be under pressure in a body: its cavities or, if it has none, itself.

    They point away from it: into the body's material around cavities, out of the body otherwise.
    """
    facets = mesh.boundary[mesh.bodies[mesh.boundary_cells] == body]
    part = connected_facets(facets)
    cavities = [p for p in np.unique(part) if enclosed_volume(mesh.points, facets[part == p]) < 0.0]
    chosen = facets[np.isin(part, cavities)]
    return chosen[:, ::-1] if cavities else facets


def connected_facets(facets: np.ndarray) -> np.ndarray:
    """(k,) the connected part of each facet (k, d), where two that share an edge (3D) or a point (2D) are connected: a
    cavity that touches the outer boundary at one vertex stays a part of its own.
    """
    count, d = facets.shape
    ridges = np.concatenate([np.sort(np.delete(facets, corner, axis=1), axis=1) for corner in range(d)])
    ridge = np.unique(ridges, axis=0, return_inverse=True)[1].ravel()
    owners = np.tile(np.arange(count), d)
    return connected_parts(np.column_stack([owners, count + ridge]), count + int(ridge.max()) + 1)[:count]


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
