"""Polygons cut into triangles that use all their corners, also those that lie on a straight edge.

Libraries that cut ears (mapbox_earcut) leave such corners out, and the surface is then open there. Here a fan is taken
where all its triangles have an area. Else the worst triangle is made as good as it can be, by the recurrence over the
polygon's chords. Triangles of positive area whose sides are the polygon's cover it without overlap.
"""

from collections.abc import Sequence

import numpy as np

MOST_CORNERS = 200
"""Corners of a polygon that are cut by the recurrence; its time grows with their square, 0.9 s for so many."""
SMALL_AREA = 1e-9
"""Area, relative to the square of the longest side, below which a fan's triangle counts as flat."""


def cut_polygons(points: np.ndarray, polygons: np.ndarray) -> np.ndarray:
    """Triangles of polygons with equally many corners each.

    Parameters
    ----------
    points : (n, 2) or (n, 3) [m]
    polygons : (k, c) integer

    Returns
    -------
    (k, c - 2, 3) int64

    Raises
    ------
    ValueError
        A polygon of more than `MOST_CORNERS` corners is no fan.
    """
    polygons = np.asarray(polygons, dtype=np.int64)
    count, corners = polygons.shape
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
        best = _best(_flattened(place[k], normals[k] / lengths[k]))
        if best is not None:
            fans[k] = polygons[k][best]
    return fans


def cut_faces(points: np.ndarray, faces: Sequence[Sequence[int]]) -> np.ndarray:
    """Triangles (m, 3) int64 of polygons with various numbers of corners, in their order."""
    counts = np.array([len(face) for face in faces])
    cut: list[np.ndarray] = [np.empty(0)] * len(faces)
    for corners in np.unique(counts):
        mine = np.flatnonzero(counts == corners)
        triangles = cut_polygons(points, np.array([faces[i] for i in mine], dtype=np.int64))
        for i, made in zip(mine, triangles, strict=True):
            cut[i] = made
    return np.concatenate(cut) if cut else np.empty((0, 3), dtype=np.int64)


def _flattened(place: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Corners (c, 3) in the plane across a unit normal, (c, 2), anticlockwise."""
    first = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    first /= np.linalg.norm(first)
    return np.column_stack([place @ first, place @ np.cross(normal, first)])


def _best(p: np.ndarray) -> np.ndarray | None:
    """Triangles (c - 2, 3) of a polygon (c, 2) whose worst one is as good as can be; None where one must be flat."""
    n = len(p)
    worth, split = np.full((n, n), -np.inf), np.zeros((n, n), dtype=np.int64)
    worth[np.arange(n - 1), np.arange(1, n)] = np.inf
    for span in range(2, n):
        starts = np.arange(n - span)
        ends = starts + span
        for step in range(1, span):
            middles = starts + step
            a, b, c = p[middles] - p[starts], p[ends] - p[middles], p[starts] - p[ends]
            area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
            quality = area / np.maximum((a**2 + b**2 + c**2).sum(axis=1), np.finfo(float).tiny)
            found = np.minimum(np.minimum(worth[starts, middles], worth[middles, ends]), quality)
            better = found > worth[starts, ends]
            worth[starts[better], ends[better]] = found[better]
            split[starts[better], ends[better]] = middles[better]
    if worth[0, n - 1] <= SMALL_AREA:
        return None
    triangles, chords = [], [(0, n - 1)]
    while chords:
        i, j = chords.pop()
        if j - i > 1:
            k = int(split[i, j])
            triangles.append((i, k, j))
            chords += [(i, k), (k, j)]
    return np.array(triangles)
