"""The mesh of one level: every body's cells in one set of arrays, replicated on all ranks in the input's order."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

CELLS_AT_ONCE = 65_536
"""Cells whose determinants are taken at once: each needs 168 bytes of work room, and a level may have millions."""


@dataclass(frozen=True, eq=False)
class LevelMesh:
    """All bodies of one level, placed in the scene, at rest.

    Attributes
    ----------
    points : (n, d) float64 [m]
        Rest positions. Every point belongs to a cell.
    cells : (m, d + 1) int64
        Positively oriented simplices.
    bodies : (m,) int32
        Index of the body that owns each cell.
    regions : (m,) int32
        Label of the region each cell belongs to, within its body.
    places : (n, d) float64 [m], optional
        Point of the input's shape that each point stands for; not given where they are the same.
    """

    points: np.ndarray
    cells: np.ndarray
    bodies: np.ndarray
    regions: np.ndarray
    places: np.ndarray | None = None

    def __repr__(self) -> str:
        return f"LevelMesh(points={self.points.shape}, cells={self.cells.shape}, bodies={len(np.unique(self.bodies))})"

    @property
    def dim(self) -> int:
        return self.points.shape[1]

    @property
    def on_the_shape(self) -> np.ndarray:
        """(n, d) [m]: `places`, or the points. Choices by place use them: all levels choose the same part."""
        return self.points if self.places is None else self.places

    @cached_property
    def point_bodies(self) -> np.ndarray:
        """(n,) int32: the body of each point."""
        owner = np.zeros(len(self.points), dtype=np.int32)
        owner[self.cells] = self.bodies[:, None]
        return owner

    @cached_property
    def boundary(self) -> np.ndarray:
        """(k, d) int64: boundary facets, outward (3D) or with the inside on their left (2D)."""
        return self._boundary[0]

    @cached_property
    def boundary_cells(self) -> np.ndarray:
        """(k,) int64: the cell behind each boundary facet."""
        return self._boundary[1]

    @cached_property
    def _boundary(self) -> tuple[np.ndarray, np.ndarray]:
        return boundary_facets(self.cells)

    @cached_property
    def inner_facets(self) -> tuple[np.ndarray, np.ndarray]:
        """(k, 2) int64, (k, 2) int64: the cells beside each inner facet, and which of their corners is opposite."""
        m = len(self.cells)
        order, same = _sorted_facets(self.cells)
        sides = np.column_stack([order[:-1][same], order[1:][same]])
        return sides % m, sides // m

    @cached_property
    def volumes(self) -> np.ndarray:
        """(m,) float64 [m^d]: signed volumes at rest."""
        return simplex_volumes(self.points, self.cells)

    @cached_property
    def hat_gradients(self) -> np.ndarray:
        """(m, d + 1, d) float64 [1/m]: gradient of each corner's hat function in each cell, at rest."""
        return self._hat_gradients(self.cells)

    def gradients_in(self, cells: np.ndarray) -> np.ndarray:
        """(k, d + 1, d) [1/m]: `hat_gradients` of some cells (k,). Those of all, 96 bytes a cell, are not kept."""
        return self.hat_gradients[cells] if "hat_gradients" in vars(self) else self._hat_gradients(self.cells[cells])

    def _hat_gradients(self, cells: np.ndarray) -> np.ndarray:
        corners = self.points[cells]
        others = np.linalg.inv(corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
        return np.concatenate([-others.sum(axis=1, keepdims=True), others], axis=1)

    def coordinates(self, cells: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Barycentric coordinates (k, d + 1) of points (k, d) in cells (k,) at rest: of any sign, they sum to one."""
        # A product and a sum, not einsum or matmul: a row must not depend on its place in the array, which differs
        # between ranks.
        arms = (points - self.points[self.cells[cells, 0]])[:, None]
        others = (self.gradients_in(cells)[:, 1:] * arms).sum(axis=2)
        return np.column_stack([1.0 - others.sum(axis=1), others])

    def body(self, number: int) -> tuple["LevelMesh", np.ndarray]:
        """One body as a mesh of its own, and its points' indices here."""
        mine = self.bodies == number
        points, cells = np.unique(self.cells[mine], return_inverse=True)
        return (
            LevelMesh(
                self.points[points],
                cells.reshape(-1, self.dim + 1),
                self.bodies[mine],
                self.regions[mine],
                None if self.places is None else self.places[points],
            ),
            points,
        )


def body_sizes(mesh: LevelMesh) -> np.ndarray:
    """(bodies,) [m]: the diagonal of the box around each body at rest."""
    bodies = mesh.point_bodies
    return np.array([np.linalg.norm(np.ptp(mesh.points[bodies == i], axis=0)) for i in range(int(bodies.max()) + 1)])


def lumped_masses(mesh: LevelMesh, densities: Sequence[float] | np.ndarray) -> np.ndarray:
    """(n,) [kg]: each vertex's part of its cells' masses; one density [kg/m^d] per cell."""
    parts = mesh.volumes * np.asarray(densities, dtype=float) / (mesh.dim + 1)
    return np.bincount(mesh.cells.ravel(), np.repeat(parts, mesh.dim + 1), minlength=len(mesh.points))


def simplex_volumes(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Signed areas (2D) or volumes (3D), shape (m,)."""
    volumes, dim = np.empty(len(cells)), points.shape[1]
    for first in range(0, len(cells), CELLS_AT_ONCE):
        corners = points[cells[first : first + CELLS_AT_ONCE]]
        volumes[first : first + CELLS_AT_ONCE] = np.linalg.det(corners[:, 1:] - corners[:, :1])
    return volumes / (2.0 if dim == 2 else 6.0)


def simplex_centres(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The mean of each cell's corners, shape (m, d)."""
    centres = points[cells[:, 0]]
    for corner in range(1, cells.shape[1]):
        centres += points[cells[:, corner]]
    return centres / cells.shape[1]


def facet_sizes(points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """(k,) lengths [m] of edges (k, 2) in 2D, areas [m^2] of triangles (k, 3) in 3D."""
    edges = points[facets[:, 1:]] - points[facets[:, :1]]
    if points.shape[1] == 2:
        return np.linalg.norm(edges[:, 0], axis=1)
    return np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2


def connected_parts(simplices: np.ndarray, count: int) -> np.ndarray:
    """(count,) the connected part of each point, where those of a simplex (k, c) connect; numbered by first points."""
    from scipy.sparse import coo_array  # where it is called: stored runs are read without SciPy
    from scipy.sparse.csgraph import connected_components

    ends = np.repeat(simplices[:, 0], simplices.shape[1] - 1), simplices[:, 1:].ravel()
    return connected_components(coo_array((np.ones(len(ends[0])), ends), shape=(count, count)), directed=False)[1]


def boundary_areas(mesh: LevelMesh) -> np.ndarray:
    """(n,) each vertex's part of the boundary in the rest shape [m^(d-1)], zero inside."""
    size = facet_sizes(mesh.points, mesh.boundary)
    return np.bincount(mesh.boundary.ravel(), np.repeat(size / mesh.dim, mesh.dim), minlength=len(mesh.points))


def boundary_facets(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Facets that belong to one cell only, oriented outward, and that cell's index."""
    m, corners = cells.shape
    order, same = _sorted_facets(cells)
    alone = order[~np.append(same, False) & ~np.append(False, same)]
    owners, opposite = np.divmod(np.sort(alone % m * corners + alone // m), corners)
    outward = {3: [[1, 2], [2, 0], [0, 1]], 4: [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]]}[corners]
    return cells[owners[:, None], np.array(outward)[opposite]], owners


def _sorted_facets(cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The facets of cells (m, d + 1) in the order of their vertices (k,) int64, where facet c m + i lies opposite to
    corner c of cell i; and whether each has the vertices of the next one (k - 1,) bool.
    """
    m, corners = cells.shape
    low, high = np.empty((corners, m), dtype=np.int64), np.empty((corners, m), dtype=np.int64)
    for corner in range(corners):
        facets = np.sort(np.delete(cells, corner, axis=1), axis=1)
        # two numbers for three vertices: unique rows take five times as long and more than twice the memory
        low[corner], high[corner] = facets[:, 0], facets[:, -1] * (int(cells.max(initial=0)) + 1) + facets[:, 1]
    order = np.lexsort((low.ravel(), high.ravel()))
    low, high = low.ravel()[order], high.ravel()[order]
    return order, (low[1:] == low[:-1]) & (high[1:] == high[:-1])


def principal_stretches(mesh: LevelMesh, positions: np.ndarray) -> np.ndarray:
    """(m, d): singular values of each cell's deformation gradient, descending; `positions` (n, d) [m]."""
    return np.linalg.svd(np.einsum("mci,mcj->mij", positions[mesh.cells], mesh.hat_gradients), compute_uv=False)


def vertex_strain(mesh: LevelMesh, positions: np.ndarray) -> np.ndarray:
    """(n,): the largest |principal stretch - 1| of the cells about each vertex, a mean over their volumes at rest;
    `positions` (n, d) [m].
    """
    corners, count = mesh.cells.ravel(), len(mesh.points)
    volumes = np.repeat(mesh.volumes, mesh.dim + 1)
    largest = np.repeat(abs(principal_stretches(mesh, positions) - 1.0).max(axis=1), mesh.dim + 1)
    return np.bincount(corners, volumes * largest, count) / np.bincount(corners, volumes, count)
