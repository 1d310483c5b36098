"""Vertices at one place, made one: of a surface's seams, which many exporters leave open."""

import numpy as np
from scipy.spatial import cKDTree

from pdvol.geometry.crossings import counted_edges
from pdvol.geometry.level_mesh import connected_parts
from pdvol.meshes import Surface

COINCIDENT = 1e-8
"""Distance, relative to the diagonal, up to which two vertices count as one: round-off of an export in text."""


def open_edges(triangles: np.ndarray) -> np.ndarray:
    """Edges (e, 2) that belong to one triangle only."""
    edges, _, counts = counted_edges(triangles)
    return edges[counts == 1]


def coincident(points: np.ndarray, distance: float, groups: np.ndarray | None = None) -> np.ndarray:
    """(n,) for each point the first one at its place: nearer than `distance` [m], also over others between; only of its
    own group (n,) where groups are given.
    """
    groups = np.zeros(len(points), dtype=np.int64) if groups is None else groups
    if distance == 0.0:
        _, first, index = np.unique(np.column_stack([points, groups]), axis=0, return_index=True, return_inverse=True)
        return first[index.ravel()]
    pairs = cKDTree(points).query_pairs(distance, output_type="ndarray")
    pairs = pairs[groups[pairs[:, 0]] == groups[pairs[:, 1]]]
    group = connected_parts(pairs, len(points))
    _, first = np.unique(group, return_index=True)
    return first[group]


def seam_vertices(points: np.ndarray, triangles: np.ndarray) -> int:
    """Number of vertices of open edges that coincide with another one within `COINCIDENT`."""
    at_seams = np.unique(open_edges(triangles))
    if len(at_seams) == 0:
        return 0
    size = float(np.linalg.norm(np.ptp(points[triangles.ravel()], axis=0)))
    _, counts = np.unique(coincident(points[at_seams], COINCIDENT * size), return_counts=True)
    return int(counts[counts > 1].sum())


def weld_open(surface: Surface) -> tuple[Surface, list[str]]:
    """An open surface with its exact duplicates of vertices welded, and a line that says so; others as they are.

    Vertices keep their order. Triangles that lose a corner by it are kept, for `check_surface` to name.
    """
    points, triangles = surface.vertices, surface.triangles
    sound = len(triangles) and triangles.min() >= 0 and triangles.max() < len(points) and np.isfinite(points).all()
    if not sound or len(open_edges(triangles)) == 0:
        return surface, []
    first = coincident(points, 0.0)
    if (first == np.arange(len(points))).all():
        return surface, []
    kept, index = np.unique(first, return_inverse=True)
    welded = index.ravel()[triangles].astype(np.int32)
    if len(open_edges(welded)) >= len(open_edges(triangles)):
        return surface, []
    lost = len(points) - len(kept)
    note = f"{lost:,} vertices repeat others exactly and are welded"
    return Surface(np.ascontiguousarray(points[kept]), welded), [note]
