"""Polygons cut into triangles that use all their corners, also those that lie on a straight edge.

Most libraries that cut ears (mapbox_earcut) leave such corners out, and the surface is then open there; VTK does not.
A fan is taken where all its triangles have an area.
"""

from collections.abc import Sequence

import numpy as np

MOST_CORNERS = 200
"""Corners of a polygon that is no fan; the time to cut its ears grows with their square."""
BRIDGE = 1e-4
"""Distance, in longest sides, by which corners move inward where some repeat, as those of a bridge to a hole: VTK cuts
no polygon that touches itself within 1e-6.
"""
SMALL_AREA = 1e-9
"""Area, relative to the square of the longest side, below which a fan's triangle counts as flat."""


def cut_polygons(points: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Triangles (k, c - 2, 3) int64 of polygons (k, c) with equally many corners each, at points (n, 2) or (n, 3) [m].

    It raises ValueError where a polygon of more than `MOST_CORNERS` corners is no fan, or one has less than three.
    """
    polygons = np.asarray(polygons, dtype=np.int64)
    count, corners = polygons.shape
    if corners < 3:
        raise ValueError(f"a face has {corners} corners")
    fans = np.stack(
        [np.stack([polygons[:, 0], polygons[:, i], polygons[:, i + 1]], 1) for i in range(1, corners - 1)], 1
    )
    if corners == 3 or polygons.size == 0 or polygons.min() < 0 or polygons.max() >= len(points):
        return fans
    place = points[polygons]
    if place.shape[2] == 2:
        place = np.concatenate([place, np.zeros((count, corners, 1))], axis=2)
    place = place - place[:, :1]
    normals = np.cross(place, np.roll(place, -1, axis=1)).sum(axis=1)
    lengths = np.linalg.norm(normals, axis=1)
    areas = np.stack(
        [np.einsum("ij,ij->i", np.cross(place[:, i], place[:, i + 1]), normals) for i in range(1, corners - 1)], 1
    )
    longest = np.linalg.norm(place - np.roll(place, 1, axis=1), axis=2).max(axis=1)
    broken = (areas <= SMALL_AREA * (lengths * longest**2)[:, None]).any(axis=1) & (lengths > 0.0)
    for k in np.flatnonzero(broken):
        if corners > MOST_CORNERS:
            raise ValueError(f"a polygon of {corners} corners is not convex, cut the mesh into triangles before")
        one = place[k] / longest[k]
        ears = _ears_cut(one)
        if ears is None and len(np.unique(one, axis=0)) < corners:
            aside = np.cross(normals[k] / lengths[k], np.roll(one, -1, axis=0) - one)
            ears = _ears_cut(one + BRIDGE * (aside + np.roll(aside, 1, axis=0)))
        if ears is not None:
            fans[k] = polygons[k][ears]
    return fans


def cut_faces(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """Triangles (m, 3) int64 of polygons with various numbers of corners, in their order."""
    counts = np.array([len(face) for face in faces])
    cut: list[np.ndarray] = [np.empty(0)] * len(faces)
    for corners in np.unique(counts):
        mine = np.flatnonzero(counts == corners)
        for i, made in zip(mine, cut_polygons(points, np.array([faces[i] for i in mine], dtype=np.int64)), strict=True):
            cut[i] = made
    return np.concatenate(cut) if cut else np.empty((0, 3), dtype=np.int64)


def _ears_cut(place: np.ndarray) -> np.ndarray | None:
    """Triangles (c - 2, 3) of a polygon with corners (c, 3); None where VTK cuts none."""
    from vtkmodules.vtkCommonCore import vtkIdList  # takes longer than most files, which have no such polygons
    from vtkmodules.vtkCommonDataModel import vtkPolygon

    polygon, found = vtkPolygon(), vtkIdList()
    polygon.GetPoints().SetDataTypeToDouble()
    for number, corner in enumerate(place):
        polygon.GetPointIds().InsertNextId(number)
        polygon.GetPoints().InsertNextPoint(corner)
    if not polygon.EarCutTriangulation(found, vtkPolygon.DOT_PRODUCT):
        return None
    triangles = np.array([found.GetId(k) for k in range(found.GetNumberOfIds())], dtype=np.int64).reshape(-1, 3)
    return triangles if len(triangles) == len(place) - 2 else None
