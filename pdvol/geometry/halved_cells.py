"""Simplices cut at the middles of their edges: triangles into four, tetrahedra into eight."""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh, simplex_volumes

_EDGES = {2: np.array([[0, 1], [0, 2], [1, 2]]), 3: np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])}
# By corners and, behind them, the middles of the edges: the cells at the corners, then those within. In a tetrahedron
# these lie around the line between the middles of two opposite edges.
_TRIANGLES = [[0, 3, 4], [1, 3, 5], [2, 4, 5], [3, 5, 4]]
_CORNERS = [[0, 4, 5, 6], [1, 4, 7, 8], [2, 5, 7, 9], [3, 6, 8, 9]]
_AROUND = {
    0: [[4, 9, 5, 7], [4, 9, 5, 6], [4, 9, 7, 8], [4, 9, 8, 6]],
    1: [[5, 8, 4, 6], [5, 8, 6, 9], [5, 8, 9, 7], [5, 8, 7, 4]],
}


def halved(points: np.ndarray, cells: np.ndarray, line: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """A mesh with each edge halved: points (n + edges, d), the given ones first, and cells (2^d m, d + 1), the parts of
    a cell in a row.

    Parameters
    ----------
    line : within a tetrahedron, from the middle of this edge (0: from corner 0 to 1, 1: from corner 0 to 2) to that of
        the opposite one
    """
    d, n = points.shape[1], len(points)
    ends = np.sort(cells[:, _EDGES[d]].reshape(-1, 2), axis=1)
    keys, middle = np.unique(ends[:, 0] * n + ends[:, 1], return_inverse=True)
    first, second = np.divmod(keys, n)
    everything = np.concatenate([points, 0.5 * (points[first] + points[second])])
    corners_and_middles = np.column_stack([cells, n + middle.reshape(len(cells), -1)])
    parts = np.array(_TRIANGLES if d == 2 else [*_CORNERS, *_AROUND[line]])
    return everything, oriented(everything, corners_and_middles[:, parts].reshape(-1, d + 1))


def oriented(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """The cells with positive volumes."""
    turned = cells.copy()
    inside_out = simplex_volumes(points, cells) < 0.0
    turned[inside_out, 1], turned[inside_out, -1] = cells[inside_out, -1], cells[inside_out, 1]
    return turned


def halved_cells(mesh: LevelMesh) -> LevelMesh:
    """A level with edges half as long; its first points are those of `mesh`."""
    points, cells = halved(mesh.points, mesh.cells)
    parts = 2**mesh.dim
    return LevelMesh(points, cells, np.repeat(mesh.bodies, parts), np.repeat(mesh.regions, parts))
