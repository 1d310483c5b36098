"""How many cells lie through the thinnest part of a body: the fewest edges from a boundary facet to the one behind."""

import numpy as np
import scipy.sparse as sp

from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.geometry.flat_faces import unit_normals
from pdvol.geometry.level_mesh import LevelMesh, facet_sizes
from pdvol.levels.geodesic import vertex_adjacency

FACING = -0.7  # cosine between the normals of two facets below which they are the two sides of a part
THINNEST_SHARE = 0.01  # of the area of a body's facets with another side: the thinnest ones set its thickness
AS_THIN = 1.5  # ratio of thicknesses up to which facets belong to the thinnest part
LOOKED_AT = 200  # facets of it whose cells are counted: more take longer and change no median
MOST_CELLS = 10  # cells that are counted
INSET = 1e-6  # of a body's size: rays begin so far inside


def cells_through(mesh: LevelMesh, number: int) -> tuple[int, float]:
    """Cells through the thinnest part of a body, its median and `MOST_CELLS` at most, and its thickness [m]."""
    mesh = mesh.body(number)[0]
    facets = mesh.boundary
    normals = unit_normals(mesh.points, facets)
    size, centres = float(np.linalg.norm(np.ptp(mesh.points, axis=0))), mesh.points[facets].mean(axis=1)
    behind, away = BoundarySearch(mesh, number).first_hits(centres - INSET * size * normals, centres - size * normals)
    away += INSET * size
    facing = (behind >= 0) & ((normals * normals[behind]).sum(axis=1) < FACING)
    facing &= ~(facets[:, :, None] == facets[behind][:, None]).any(axis=(1, 2))
    if not facing.any():
        return 1, float(away.min())
    order = np.flatnonzero(facing)[np.argsort(away[facing], kind="stable")]
    areas = np.cumsum(facet_sizes(mesh.points, facets[order]))
    thickness = float(away[order[np.searchsorted(areas, THINNEST_SHARE * areas[-1])]])
    part = order[away[order] <= AS_THIN * thickness]
    part = part[:: -(-len(part) // LOOKED_AT)]
    row, shape = np.repeat(np.arange(len(part)), mesh.dim), (len(part), len(mesh.points))
    reached, wanted = (
        sp.csr_array((np.ones(len(row)), (row, facets[which].ravel())), shape=shape) for which in (part, behind[part])
    )
    adjacency = vertex_adjacency(mesh).astype(float)
    for count in range(1, MOST_CELLS):
        reached = (reached + reached @ adjacency).sign()
        if (reached * wanted).sum(axis=1).astype(bool).mean() >= 0.5:
            return count, thickness
    return MOST_CELLS, thickness
