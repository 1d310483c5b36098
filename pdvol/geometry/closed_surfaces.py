"""Closed surfaces of bodies: what they enclose, and which of them are cavities."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pdvol.geometry.level_mesh import LevelMesh


def enclosed_volume(points: np.ndarray, facets: np.ndarray) -> float:
    """Area (2D) or volume (3D) within closed facets (k, d) that point outward; negative where they point inward."""
    corners = points[facets]
    corners = corners - corners.mean(axis=(0, 1))
    return float(np.linalg.det(corners).sum()) / (2.0 if points.shape[1] == 2 else 6.0)


def pressed_facets(mesh: LevelMesh, body: int) -> np.ndarray:
    """(k, d) int64: the facets around what can be under pressure in a body: its cavities or, if it has none, itself.

    They point away from it: into the body's material around cavities, out of the body otherwise.
    """
    facets = mesh.boundary[mesh.bodies[mesh.boundary_cells] == body]
    part = _parts(facets)
    cavities = [p for p in range(part.max() + 1) if enclosed_volume(mesh.points, facets[part == p]) < 0.0]
    chosen = facets[np.isin(part, cavities)]
    return chosen[:, ::-1] if cavities else facets


def _parts(facets: np.ndarray) -> np.ndarray:
    """(k,) int: the connected part of each facet; facets that share an edge (3D) or a point (2D) are connected."""
    count, d = facets.shape
    ridges = np.concatenate([np.sort(np.delete(facets, corner, axis=1), axis=1) for corner in range(d)])
    _, ridge = np.unique(ridges, axis=0, return_inverse=True)
    ridge = ridge.ravel()
    owners = np.tile(np.arange(count), d)
    graph = coo_array(
        (np.ones(2 * len(ridge)), (np.r_[owners, count + ridge], np.r_[count + ridge, owners])),
        shape=(count + ridge.max() + 1,) * 2,
    )
    return np.unique(connected_components(graph, directed=False)[1][:count], return_inverse=True)[1]
