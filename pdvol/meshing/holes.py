"""Open edges of a surface: seams that are nearly closed, and holes with their rims and covers."""

import igl
import numpy as np
from scipy.spatial import cKDTree

from pdvol.geometry.crossings import counted_edges
from pdvol.meshing.polygons import MOST_CORNERS, cut_polygons
from pdvol.meshing.validate import flat_triangles
from pdvol.meshing.weld import open_edges

ON_AN_EDGE = 1e-6
"""Distance in diagonals up to which a vertex lies on an edge: round-off of single precision."""
NEAR_RIM = 0.1
"""Distance of two vertices of open edges, relative to these edges, below which they may have been one."""


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


def divided_edges(points: np.ndarray, triangles: np.ndarray, distance: float) -> tuple[np.ndarray, int]:
    """Triangles at open edges, divided at other vertices of open edges that lie nearer than `distance` [m]: where only
    one of two sides divides an edge, both then do. And how many edges are divided.
    """
    divided = 0
    for _ in range(3):  # each edge of a triangle
        edges, which, counts = counted_edges(triangles)
        side = np.empty(len(edges), dtype=np.int64)
        side[which] = np.arange(len(which))  # of an open edge the only one
        edges, side = edges[counts == 1], side[counts == 1]
        rim, ends, kept, more = np.unique(edges), points[edges], np.ones(len(triangles), dtype=bool), list[tuple]()
        reach = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2 - 2 * distance  # what lies at its ends is left out
        found = cKDTree(points[rim]).query_ball_point(ends.mean(axis=1), np.maximum(reach, 0.0))
        for e in np.flatnonzero([len(one) > 0 for one in found]):
            t, k = divmod(side[e], 3)
            a, b, c = np.roll(triangles[t], -k)
            near, along = rim[found[e]][rim[found[e]] != c], points[b] - points[a]
            share = (points[near] - points[a]) @ along / (along @ along)
            on = np.linalg.norm(points[near] - points[a] - share[:, None] * along, axis=1) <= distance
            if on.any() and kept[t]:
                chain = [a, *near[on][np.argsort(share[on])], b]
                more += [(*pair, c) for pair in zip(chain, chain[1:], strict=False)]
                kept[t], divided = False, divided + 1
        if kept.all():
            break
        triangles = np.vstack([triangles[kept], np.array(more, dtype=np.int64)])
    return triangles, divided


def near_seam(points: np.ndarray, triangles: np.ndarray, size: float) -> str:
    """Advice where the vertices of open edges mostly lie much nearer to others than these edges are long; `size` is the
    surface's diagonal [m].
    """
    edges = open_edges(triangles)
    rim, index = np.unique(edges, return_inverse=True)
    if len(rim) < 2:
        return ""
    lengths = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    least = np.full(len(rim), np.inf)
    np.minimum.at(least, index.reshape(-1, 2), lengths[:, None])
    gaps = cKDTree(points[rim]).query(points[rim], k=2)[0][:, 1]
    near = gaps < NEAR_RIM * least
    if 2 * near.sum() <= len(rim):
        return ""
    share = 2.0 * gaps[near].max() / size
    return f"--weld {share:.1g} joins vertices of open edges that lie near each other"
