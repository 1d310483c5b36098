"""Each tetrahedron cut into eight, at the middles of its edges."""

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh, simplex_volumes

_EDGES = np.array([[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]])
# Corners 0 to 3 and, in the order of the edges, middles 4 to 9: four cells at the corners, four around the line between
# the middles of the edges 02 and 13.
_PARTS = np.array(
    [[0, 4, 5, 6], [4, 1, 7, 8], [5, 7, 2, 9], [6, 8, 9, 3], [5, 8, 4, 6], [5, 8, 6, 9], [5, 8, 9, 7], [5, 8, 7, 4]]
)


def halved_cells(mesh: LevelMesh) -> LevelMesh:
    """A mesh of tetrahedra with edges half as long; its first points are those of `mesh`."""
    ends = np.sort(mesh.cells[:, _EDGES].reshape(-1, 2), axis=1)
    n = len(mesh.points)
    keys, middle = np.unique(ends[:, 0] * n + ends[:, 1], return_inverse=True)
    first, second = np.divmod(keys, n)
    points = np.concatenate([mesh.points, 0.5 * (mesh.points[first] + mesh.points[second])])
    all_ten = np.column_stack([mesh.cells, n + middle.reshape(-1, len(_EDGES))])
    cells = all_ten[:, _PARTS].reshape(-1, 4)
    turned = simplex_volumes(points, cells) < 0.0
    cells[turned] = cells[turned][:, [1, 0, 2, 3]]
    parts = len(_PARTS)
    return LevelMesh(points, cells, np.repeat(mesh.bodies, parts), np.repeat(mesh.regions, parts))
