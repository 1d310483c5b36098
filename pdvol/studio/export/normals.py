"""Normals by the corner of a face: smooth over faces that meet at a small angle, sharp at creases.

The creases are those of the rest shape, of an obstacle those of its start, so that none comes and goes in an animation.
Corners of one vertex that no crease parts have one normal, the mean of their faces' normals, weighted by area.
"""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import connected_components

from pdvol.studio.export.parts import Part
from pdvol.studio.shown import CREASE_ANGLE


class CornerNormals:
    """The normals of a part.

    Attributes
    ----------
    index : (c,) int
        Which normal each corner has.
    """

    def __init__(self, part: Part):
        self._counts, self._corners = part.counts, part.corners
        welded = part.corners if part.render is None else part.render.first[part.corners]
        self.index = _index(welded, part.counts, self._areas(part.rest))
        faces = np.repeat(np.arange(len(part.counts)), part.counts)
        shape = (int(self.index.max(initial=-1)) + 1, len(part.counts))
        self._sum = csr_matrix((np.ones(len(faces)), (self.index, faces)), shape=shape)

    def at(self, points: np.ndarray) -> np.ndarray:
        """(k, 3) unit normals with the vertices at `points` (n, 3) [m]; zero where the faces have no area."""
        sums = self._sum @ self._areas(points)
        return sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), np.finfo(float).tiny)

    def _areas(self, points: np.ndarray) -> np.ndarray:
        """(f, 3) twice the area of each polygon along its normal (Newell's method) [m^2]."""
        if not len(self._counts):
            return np.zeros((0, 3))
        starts = np.cumsum(self._counts) - self._counts
        here = points[self._corners] - np.repeat(points[self._corners[starts]], self._counts, axis=0)
        return np.add.reduceat(np.cross(here, here[_following(self._counts)]), starts)


def _following(counts: np.ndarray) -> np.ndarray:
    """(c,) the next corner around the polygon of each corner."""
    following = np.arange(1, counts.sum() + 1)
    following[np.cumsum(counts) - 1] -= counts
    return following


def _index(corners: np.ndarray, counts: np.ndarray, areas: np.ndarray) -> np.ndarray:
    """(c,) a number for the corners of one vertex that no crease parts; faces across an edge, `areas` (f, 3) along
    their normals, meet at a crease where the angle is larger than `CREASE_ANGLE`.
    """
    normals = areas / np.maximum(np.linalg.norm(areas, axis=1, keepdims=True), np.finfo(float).tiny)
    faces, following = np.repeat(np.arange(len(counts)), counts), _following(counts)
    edges = np.sort(np.column_stack([corners, corners[following]]), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order[:-1]] == edges[order[1:]]).all(axis=1)
    one, other = order[:-1][same], order[1:][same]
    smooth = (normals[faces[one]] * normals[faces[other]]).sum(axis=1) >= np.cos(np.radians(CREASE_ANGLE))
    smooth &= corners[one] != corners[other]  # neighbours of one orientation pass their edge in opposite directions
    one, other = one[smooth], other[smooth]
    pairs = np.concatenate([one, following[one]]), np.concatenate([following[other], other])
    joined = coo_matrix((np.ones(len(pairs[0])), pairs), shape=(len(corners), len(corners)))
    return connected_components(joined, directed=False)[1]
