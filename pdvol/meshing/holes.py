"""Holes of a surface: their rims, and covers for them."""

import igl
import numpy as np

from pdvol.meshing.polygons import MOST_CORNERS, cut_polygons
from pdvol.meshing.validate import flat_triangles


def filled_holes(points: np.ndarray, triangles: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray, int, int]:
    """The surface with holes covered whose rim is at most `most` [m] long; how many these and the larger ones are.

    Vertices must be manifold. A cover is a cut polygon, or a fan about the middle.
    """
    filled, large, covers = 0, 0, [triangles]
    added: list[np.ndarray] = []
    for loop in igl.boundary_loop_all(np.ascontiguousarray(triangles, dtype=np.int64)):
        rim = np.array(loop[::-1])  # so that a cover agrees with the triangles around it
        if np.linalg.norm(points[rim] - np.roll(points[rim], 1, axis=0), axis=1).sum() > most:
            large += 1
            continue
        filled += 1
        cover = cut_polygons(points, rim[None])[0] if len(rim) <= MOST_CORNERS else None
        if cover is None or len(flat_triangles(points, cover)):
            middle = len(points) + len(added)
            added.append(points[rim].mean(axis=0))
            cover = np.column_stack([rim, np.roll(rim, -1), np.full(len(rim), middle)])
        covers.append(cover)
    return np.vstack([points, *added]) if added else points, np.concatenate(covers), filled, large
