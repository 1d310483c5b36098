"""Holes of a surface: their rims, and covers for them."""

import numpy as np

from pdvol.meshing.polygons import MOST_CORNERS, cut_polygons
from pdvol.meshing.validate import flat_triangles
from pdvol.meshing.weld import open_edges


def filled_holes(points: np.ndarray, triangles: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray, int, int]:
    """The surface with holes covered whose rim is at most `most` [m] long; how many these and the larger ones are.

    A cover is a cut polygon, or a fan about the middle.
    """
    filled, large, covers = 0, 0, [triangles]
    added: list[np.ndarray] = []
    for rim in _rims(triangles):
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


def _rims(triangles: np.ndarray) -> list[np.ndarray]:
    """The closed loops of open edges, each so directed that a cover agrees with the triangles around it."""
    sides = triangles[:, [[1, 0], [2, 1], [0, 2]]].reshape(-1, 2)
    single = {tuple(edge) for edge in np.sort(open_edges(triangles), axis=1).tolist()}
    following: dict[int, list[int]] = {}
    for side in sides:
        a, b = int(side[0]), int(side[1])
        if (min(a, b), max(a, b)) in single:
            following.setdefault(a, []).append(b)
    rims = []
    while following:
        path: list[int] = [next(iter(following))]
        place = {path[0]: 0}
        while path:
            ahead = following.get(path[-1])
            if not ahead:
                path.pop()  # an edge without a continuation belongs to no loop
                break
            b = ahead.pop()
            if not ahead:
                del following[path[-1]]
            if b in place:  # a loop is closed; what led to it goes on
                loop = path[place[b] :]
                rims.append(np.array(loop))
                for v in loop[1:]:
                    del place[v]
                path = path[: place[b] + 1]
                if not following.get(b):
                    break
            else:
                place[b] = len(path)
                path.append(b)
    return [rim for rim in rims if len(rim) > 2]
