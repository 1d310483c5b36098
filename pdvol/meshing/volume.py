"""Meshes that keep the volume, so the mass, of the shape they were made from."""

from collections.abc import Iterator

import numpy as np

from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes

VOLUME_TOLERANCE = 1e-12
"""Deviation of a mesh's volume (area in 2D), relative to the wanted one, that is round-off."""
MAX_NEWTON_STEPS = 20
"""Steps of Newton's method on a polynomial of degree 2 or 3, which has converged after about four."""


def with_volume(points: np.ndarray, cells: np.ndarray, wanted: float) -> Iterator[np.ndarray]:
    """Points (n, d) [m] at which the mesh has the `wanted` volume [m^d], the gentlest change first.

    First every vertex of the boundary moves by one distance along its normal, which moves the surface least but can
    make it cross itself or turn cells over. Then the whole mesh is scaled about its centre, which keeps every mesh
    valid. A mesh that has the volume already stays as it is.
    """
    volumes = simplex_volumes(points, cells)
    total = float(volumes.sum())
    if abs(total - wanted) <= VOLUME_TOLERANCE * wanted:
        yield points
        return
    moved = _offset(points, cells, wanted)
    if abs(float(simplex_volumes(moved, cells).sum()) - wanted) <= VOLUME_TOLERANCE * wanted:
        yield moved
    centre = volumes @ points[cells].mean(axis=1) / total
    yield centre + (wanted / total) ** (1.0 / points.shape[1]) * (points - centre)


def _offset(points: np.ndarray, cells: np.ndarray, wanted: float) -> np.ndarray:
    """The points with the boundary's vertices moved along their normals by the distance that gives the volume; by
    Newton's method on that distance.
    """
    facets, _ = boundary_facets(cells)
    gradient = _volume_gradient(points, facets)
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    directions = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0)
    moved, distance = points, 0.0
    for _ in range(MAX_NEWTON_STEPS):
        lack = wanted - float(simplex_volumes(moved, cells).sum())
        if abs(lack) <= 0.1 * VOLUME_TOLERANCE * wanted:
            break
        slope = float((_volume_gradient(moved, facets) * directions).sum())
        if slope <= 0.0:
            break
        distance += lack / slope
        moved = points + distance * directions
    return moved


def enclosed_volume(points: np.ndarray, facets: np.ndarray) -> float:
    """Volume [m^3] inside outward triangles (k, 3), area [m^2] inside edges (k, 2) with the inside on their left."""
    centred = points - points[facets].mean(axis=(0, 1))
    # A polynomial of degree d without other terms: the gradient's product with the points is d times its value.
    return float((_volume_gradient(centred, facets) * centred).sum()) / points.shape[1]


def surface_area(points: np.ndarray, triangles: np.ndarray) -> float:
    """Area [m^2] of triangles (k, 3)."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return float(np.linalg.norm(normals, axis=1).sum()) / 2.0


def _volume_gradient(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
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
