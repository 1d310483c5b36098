"""Queries against the boundary of one body: first hits of segments, closest facets. Edges in 2D, triangles in 3D."""

from collections.abc import Iterable

import igl
import numpy as np

from pdvol.geometry.level_mesh import LevelMesh

# Enlargement of facets for the ray test, relative to their size: without it a segment through a shared edge or corner
# may pass between two of them.
FACET_OVERLAP = 1e-9
# Distance beyond a segment's end, relative to its length, at which it still hits: one that ends on the surface must
# hit, whatever the rounding.
SEGMENT_OVERRUN = 1e-9
# Difference of distances that counts as none, as a fraction of the largest coordinate: above round-off of coordinates,
# far below any gap in a mesh.
FACET_TOLERANCE = 1e-12


class BoundarySearch:
    """The boundary facets of one body of a level, with search trees. Not collective.

    Everything is embedded in 3D for libigl. Facets are numbered within the body, in the order of `LevelMesh.boundary`.

    Attributes
    ----------
    cells : (k,) int64
        The cell behind each facet.
    """

    def __init__(self, mesh: LevelMesh, body: int):
        mine = mesh.bodies[mesh.boundary_cells] == body
        self.cells = mesh.boundary_cells[mine]
        self._facets = np.ascontiguousarray(mesh.boundary[mine], dtype=np.int64)
        self._points = _embed(mesh.points)
        self._tree = igl.AABB()
        self._tree.init(self._points, self._facets)

        self._corners = self._points[self._facets]
        self._slack = FACET_TOLERANCE * np.abs(self._points).max()
        self._one_facet = np.arange(mesh.dim, dtype=np.int64)[None, :]

        triangles = _triangles(self._corners)
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        # libigl's ray test compares determinants of the size of twice the triangle's area with an absolute epsilon (at
        # 1 mm it misses every triangle): in these units the smallest triangle has determinant 1 for a ray along its
        # normal.
        self._unit = np.sqrt(np.linalg.norm(normals, axis=1).min())
        self._origin = self._corners.mean(axis=(0, 1))
        self._triangles = (triangles - self._origin) / self._unit
        self._normals = normals / np.linalg.norm(normals, axis=1)[:, None]
        centres = self._triangles.mean(axis=1, keepdims=True)
        self._soup = (centres + (1.0 + FACET_OVERLAP) * (self._triangles - centres)).reshape(-1, 3)
        self._soup_faces = np.arange(len(self._soup), dtype=np.int64).reshape(-1, 3)
        self._soup_tree = igl.AABB()
        self._soup_tree.init(self._soup, self._soup_faces)

    def first_hits(self, starts: np.ndarray, ends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The first facet each segment meets.

        Parameters
        ----------
        starts, ends : (n, d) float64 [m]

        Returns
        -------
        facet : (n,) int64
            -1 without a hit.
        distance : (n,) float64 [m]
            From the start; infinite without a hit.
        """
        starts, ends = ((_embed(p) - self._origin) / self._unit for p in (starts, ends))
        lengths = np.linalg.norm(ends - starts, axis=1)
        directions = (ends - starts) / lengths[:, None]
        facet, distance, _ = self._soup_tree.intersect_ray_first(self._soup, self._soup_faces, starts, directions)
        facet, distance = np.asarray(facet, dtype=np.int64), np.full(len(starts), np.inf)
        hit = np.flatnonzero(facet >= 0)
        # libigl's hit distances are single precision: take them from the plane of the facet.
        normals = self._normals[facet[hit]]
        offsets = (normals * (self._triangles[facet[hit], 0] - starts[hit])).sum(axis=1)
        distance[hit] = np.maximum(offsets / (normals * directions[hit]).sum(axis=1), 0.0)
        miss = ~(distance <= lengths * (1.0 + SEGMENT_OVERRUN))
        facet[miss], distance[miss] = -1, np.inf
        return facet, distance * self._unit

    def closest(self, points: np.ndarray) -> np.ndarray:
        """(n,) int64: the facet closest to each point (n, d)."""
        return np.asarray(self._tree.squared_distance(self._points, self._facets, _embed(points))[1], dtype=np.int64)

    def closest_of(self, point: np.ndarray, facets: Iterable[int]) -> int:
        """The one of `facets` closest to one point (d,). Where a common corner or edge is closest, that of its facets
        whose plane is furthest away, as it faces the point most; the lowest index among equals.
        """
        position, numbers = np.zeros(3), np.array(sorted(facets))
        position[: len(point)] = point

        def squared_distance(facet: int) -> float:
            return igl.point_simplex_squared_distance(position, self._corners[facet], self._one_facet, 0)[0]

        distances = np.sqrt([squared_distance(facet) for facet in numbers])
        tied = numbers[distances <= distances.min() + self._slack]
        heights = np.abs(((position - self._corners[tied, 0]) * self._normals[tied]).sum(axis=1))
        return int(tied[(heights >= heights.max() - self._slack).argmax()])


def enclosed(points: np.ndarray, vertices: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(n,) bool: the points (n, d) inside a surface or polyline, by its winding number, which small holes and the open
    end of a sleeve leave above a half (Jacobson 2013).
    """
    facets = np.ascontiguousarray(facets, dtype=np.int64)
    return np.abs(igl.winding_number(np.ascontiguousarray(vertices), facets, np.ascontiguousarray(points))) > 0.5


def nearest_points(corners: np.ndarray, facets: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The nearest of some facets (k, d) between corners (m, d) to points (n, d): its number (n,) int64, and the point
    on it (n, d) [m].
    """
    embedded, facets = _embed(corners), np.ascontiguousarray(facets, dtype=np.int64)
    tree = igl.AABB()
    tree.init(embedded, facets)
    _, nearest, places = tree.squared_distance(embedded, facets, _embed(points))
    return np.asarray(nearest, dtype=np.int64), np.asarray(places)[:, : corners.shape[1]]


def _embed(points: np.ndarray) -> np.ndarray:
    """Points (n, d) in 3D."""
    embedded = np.zeros((len(points), 3))
    embedded[:, : points.shape[1]] = points
    return embedded


def _triangles(facets: np.ndarray) -> np.ndarray:
    """Triangles (k, 3, 3) whose section with the plane of the rays is the facet.

    A 2D edge becomes one upright triangle that is as wide as the edge at height 0: a quad's diagonal would cross that
    plane.
    """
    if facets.shape[1] == 3:
        return facets
    along = facets[:, 1] - facets[:, 0]
    up = np.linalg.norm(along, axis=1)[:, None] * np.array([0.0, 0.0, 1.0])
    return np.stack(
        [facets[:, 0] - 0.5 * along - up, facets[:, 1] + 0.5 * along - up, facets.mean(axis=1) + up], axis=1
    )
