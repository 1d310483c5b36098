"""The flat faces of a boundary, which its meshes keep exactly: a box's or a machined part's, not a curved surface's."""

from collections.abc import Iterator
from copy import copy

import igl
import numpy as np

from pdvol.geometry.boundary_search import nearest_points
from pdvol.geometry.distances import distances_to
from pdvol.geometry.level_mesh import connected_parts, facet_sizes

ONE_PLANE = 1e-4
"""Angle [rad] between neighbouring facets of one plane: round-off of coordinates in single precision."""
SHARP_ANGLE = float(np.deg2rad(40.0))
"""Angle [rad] between facets above which their edge is a feature: curved surfaces of ten facets around are smooth."""
LARGER = 4.0
"""Size of a flat face, relative to the flat pieces that it joins smoothly, at least: a facet of a curved surface is
about as large as its neighbours.
"""
LEAST_SHARE = 0.01
"""Area of a flat face that joins others smoothly, relative to the whole boundary's, at least: curved surfaces of uneven
facets have a large one here and there.
"""
NEGLIGIBLE = 1e-9
"""Part of a direction, relative to its length, that is round-off."""


class FlatFaces:
    """Flat faces of a boundary.

    Attributes
    ----------
    points : (n, d) [m]
    boundary : (m, d) int64, all facets
    facets : list of (k, d) int64, one array a face
    of_facets : (m,) the face of each facet, -1 where it is none
    normals : (f, d), offsets : (f,) [m]
        A face lies where `normals @ x = offsets`.
    """

    def __init__(self, points: np.ndarray, facets: np.ndarray):
        """Of a boundary: triangles (m, 3) in 3D, edges (m, 2) in 2D, between points (n, d)."""
        self.points, self.boundary = np.asarray(points, dtype=np.float64), facets
        normals, sizes = unit_normals(self.points, facets), facet_sizes(self.points, facets)
        beside = neighbours(facets)
        angles = np.arccos(np.clip((normals[beside[:, 0]] * normals[beside[:, 1]]).sum(axis=1), -1.0, 1.0))
        piece = connected_parts(beside[angles < ONE_PLANE], len(facets))
        areas = np.bincount(piece, sizes)
        ends = piece[beside[(angles >= ONE_PLANE) & (angles < SHARP_ANGLE)]]
        largest = np.zeros(len(areas))
        for one, other in (ends.T, ends.T[::-1]):
            np.maximum.at(largest, one, areas[other])
        flat = np.flatnonzero((areas >= LARGER * largest) & ((largest == 0) | (areas >= LEAST_SHARE * areas.sum())))
        number = np.full(len(areas), -1)
        number[flat] = np.arange(len(flat))
        self.of_facets = number[piece]
        self.facets = [facets[self.of_facets == face] for face in range(len(flat))]
        weighted = sizes[:, None] * normals
        self.normals = np.array([weighted[piece == face].sum(axis=0) for face in flat]).reshape(-1, points.shape[1])
        self.normals /= np.linalg.norm(self.normals, axis=1, keepdims=True)
        within = [self.points[np.unique(own)] for own in self.facets]
        self.offsets = np.array([np.mean(own @ n) for own, n in zip(within, self.normals, strict=True)])

    def patches(self) -> np.ndarray:
        """(m,) number of the patch of each facet: a flat face, or a connected part of the rest."""
        beside = neighbours(self.boundary)
        one = beside[self.of_facets[beside[:, 0]] == self.of_facets[beside[:, 1]]]
        return connected_parts(one, len(self.boundary))

    def relative(self, centre: np.ndarray, size: float) -> "FlatFaces":
        """The same faces in coordinates about `centre` (d,) [m] and in units of `size` [m]."""
        other = copy(self)
        other.points = (self.points - centre) / size
        other.offsets = (self.offsets - self.normals @ centre) / size
        return other

    def near(self, points: np.ndarray, distance: float) -> np.ndarray:
        """(n, f) bool: which of points (n, d) lie within `distance` [m] of each face."""
        close = abs(points @ self.normals.T - self.offsets) <= distance
        for face, facets in enumerate(self.facets):
            mine = np.flatnonzero(close[:, face])
            close[mine, face] = distances_to(points[mine], self.points, facets) <= distance
        return close

    def along(self, directions: np.ndarray, near: np.ndarray) -> np.ndarray:
        """(n, d): what is left of directions (n, d) in the planes of the faces (n, f) that each point lies on."""
        left = np.array(directions, dtype=np.float64)
        for points, planes, inverse, _ in self._meeting(near):
            own = left[points]
            part = own - own @ planes.T @ inverse.T
            zero = np.linalg.norm(part, axis=1) <= NEGLIGIBLE * np.linalg.norm(own, axis=1)
            left[points] = np.where(zero[:, None], 0.0, part)
        return left

    def nearest(self, points: np.ndarray) -> np.ndarray:
        """(n, d) [m]: the points of the whole boundary that are nearest to points (n, d)."""
        return nearest_points(self.points, self.boundary, points)[1]

    def onto(self, points: np.ndarray, near: np.ndarray) -> np.ndarray:
        """(n, d) [m]: points (n, d) moved the shortest way onto all faces (n, f) that each is near."""
        moved = points.copy()
        for own, planes, inverse, offsets in self._meeting(near):
            moved[own] -= (points[own] @ planes.T - offsets) @ inverse.T
        return moved

    def _meeting(self, near: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """For each set of faces that points lie on: the points, and normals (k, d), their pseudo-inverse (d, k) and
        offsets (k,) of the faces.
        """
        sets, of_points = np.unique(near, axis=0, return_inverse=True)
        for number, faces in enumerate(sets):
            if faces.any():
                planes = self.normals[faces]
                inverse = np.linalg.pinv(planes, rcond=1e-3)
                yield np.flatnonzero(of_points == number), planes, inverse, self.offsets[faces]


def unit_normals(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(m, d) unit normals of facets; zero where one has no size."""
    if points.shape[1] == 3:
        return np.asarray(igl.per_face_normals(points, facets.astype(np.int64), np.zeros(3)))
    along = points[facets[:, 1]] - points[facets[:, 0]]
    length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(float).tiny)
    return np.column_stack([along[:, 1], -along[:, 0]]) / length


def neighbours(facets: np.ndarray) -> np.ndarray:
    """(k, 2) facets (m, d) that share an edge (3D) or a point (2D)."""
    count, d = facets.shape
    ridges = np.concatenate([np.sort(np.delete(facets, corner, axis=1), axis=1) for corner in range(d)])
    owners = np.tile(np.arange(count), d)
    order = np.lexsort(ridges.T)
    same = (ridges[order[1:]] == ridges[order[:-1]]).all(axis=1)
    return np.column_stack([owners[order[:-1]][same], owners[order[1:]][same]])
