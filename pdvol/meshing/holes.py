"""Holes of a surface: their rims, and covers for them."""

import igl
import numpy as np

from pdvol.geometry.crossings import counted_edges
from pdvol.meshing.polygons import MOST_CORNERS, cut_polygons
from pdvol.meshing.validate import flat_triangles


def filled_holes(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The surface with its holes covered; of each a vertex (h,) and the length [m] (h,) of its rim.

    Vertices must be manifold. A cover is a cut polygon, or a fan about the middle.
    """
    starts, rims, covers = [], [], [triangles]
    added: list[np.ndarray] = []
    for loop in igl.boundary_loop_all(np.ascontiguousarray(triangles, dtype=np.int64)):
        rim = np.array(loop[::-1])  # so that a cover agrees with the triangles around it
        starts.append(rim[0])
        rims.append(np.linalg.norm(points[rim] - np.roll(points[rim], 1, axis=0), axis=1).sum())
        cover = cut_polygons(points, rim[None])[0] if len(rim) <= MOST_CORNERS else None
        near = triangles[np.isin(triangles, rim).sum(axis=1) > 1]
        # a ragged rim can make a cover along triangles that are there
        doubled = cover is not None and counted_edges(np.vstack([near, cover]))[2].max() > 2
        if cover is None or doubled or len(flat_triangles(points, cover)):
            middle = len(points) + len(added)
            added.append(points[rim].mean(axis=0))
            cover = np.column_stack([rim, np.roll(rim, -1), np.full(len(rim), middle)])
        covers.append(cover)
    return np.vstack([points, *added]) if added else points, np.concatenate(covers), np.array(starts), np.array(rims)
