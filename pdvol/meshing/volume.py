"""Meshes that keep the volume, so the mass, of the shape they were made from."""

from collections.abc import Iterator

import numpy as np

from pdvol.geometry.closed_surfaces import volume_gradient
from pdvol.geometry.flat_faces import FlatFaces
from pdvol.geometry.level_mesh import boundary_facets, simplex_centres, simplex_volumes

VOLUME_TOLERANCE = 1e-12
"""Deviation of a mesh's volume (area in 2D), relative to the wanted one, that is round-off."""
ON_A_FACE = 1e-7
"""Distance from a flat face, relative to the size, at which a vertex lies on it: round-off of single precision."""
MAX_NEWTON_STEPS = 20
"""Steps of Newton's method on a polynomial of degree 2 or 3, which has converged after about four."""


def with_volume(
    points: np.ndarray, cells: np.ndarray, wanted: float, flat: FlatFaces | None = None
) -> Iterator[np.ndarray]:
    """Points (n, d) [m] at which the mesh has the `wanted` volume [m^d], the gentlest change first.

    First every vertex of the boundary moves by one distance along its normal, which moves the surface least but can
    make it cross itself or turn cells over. Vertices on `flat` faces stay on them. Then the whole mesh is scaled about
    its centre, which keeps every mesh valid. A mesh that has the volume already stays as it is.
    """
    volumes = simplex_volumes(points, cells)
    total = float(volumes.sum())
    if abs(total - wanted) <= VOLUME_TOLERANCE * wanted:
        yield points
        return
    moved = _offset(points, cells, wanted, flat)
    if abs(float(simplex_volumes(moved, cells).sum()) - wanted) <= VOLUME_TOLERANCE * wanted:
        yield moved
    centre = volumes @ simplex_centres(points, cells) / total
    yield centre + (wanted / total) ** (1.0 / points.shape[1]) * (points - centre)


def _offset(points: np.ndarray, cells: np.ndarray, wanted: float, flat: FlatFaces | None) -> np.ndarray:
    """The points with the boundary's vertices moved along their normals by the distance that gives the volume; by
    Newton's method on that distance.
    """
    facets, _ = boundary_facets(cells)
    gradient = volume_gradient(points, facets)
    if flat is not None:
        size = float(np.linalg.norm(np.ptp(points, axis=0)))
        boundary = np.unique(facets)
        gradient[boundary] = flat.along(gradient[boundary], flat.near(points[boundary], ON_A_FACE * size))
    length = np.linalg.norm(gradient, axis=1, keepdims=True)
    directions = np.divide(gradient, length, out=np.zeros_like(gradient), where=length > 0)
    moved, distance = points, 0.0
    for _ in range(MAX_NEWTON_STEPS):
        lack = wanted - float(simplex_volumes(moved, cells).sum())
        if abs(lack) <= 0.1 * VOLUME_TOLERANCE * wanted:
            break
        slope = float((volume_gradient(moved, facets) * directions).sum())
        if slope <= 0.0:
            break
        distance += lack / slope
        moved = points + distance * directions
    return moved
