"""Which cell of a distributed level contains a point, and the material of a level that is nearest to one.

Candidates come from `dolfinx.geometry.bb_tree`. A point is in a cell when its signed distance to every facet's plane is
at least `-FACET_TOLERANCE * size`, `size` being the largest coordinate of the level. On a common facet the lowest input
cell index wins, so the answer does not depend on the number of ranks. docs/method.md has why dolfinx' own decisions,
`compute_colliding_cells` and point ownership, are not taken.
"""

import numpy as np
from mpi4py import MPI

from pdvol.compat import geometry
from pdvol.geometry.boundary_search import FACET_TOLERANCE, nearest_points
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.space import LevelSpace

# points searched at a time: bounds the memory of the candidate pairs
CHUNK = 20_000


def containing_cells(points: np.ndarray, bodies: np.ndarray, source: LevelSpace) -> np.ndarray:
    """The cell of `source` that contains each point, among the cells of the point's own body. Collective.

    Every rank searches the cells it owns; the lowest input index found by any rank is taken.

    Parameters
    ----------
    points : (n, d) float64 [m]
        Replicated on all ranks.
    bodies : (n,) int

    Returns
    -------
    (n,) int64
        Input cell index, -1 outside. Replicated.
    """
    mesh, topology = source.mesh, source.domain.topology
    owned = source.domain_cells[: topology.index_map(topology.dim).size_local]
    outside = len(mesh.cells)
    found = np.full(len(points), outside, dtype=np.int64)
    slack = FACET_TOLERANCE * np.abs(mesh.points).max()
    search = np.zeros((len(points), 3))
    search[:, : mesh.dim] = points
    for body in np.unique(mesh.bodies):
        # A tree per body: where bodies touch or overlap at rest, one point is in cells of both.
        entities = np.flatnonzero(mesh.bodies[owned] == body).astype(np.int32)
        mine = np.flatnonzero(bodies == body)
        if len(entities) == 0 or len(mine) == 0:
            continue
        tree = geometry.bb_tree(source.domain, mesh.dim, entities=entities, padding=2 * slack)
        for start in range(0, len(mine), CHUNK):
            part = mine[start : start + CHUNK]
            boxes = geometry.compute_collisions_points(tree, search[part])
            point = np.repeat(part, np.diff(boxes.offsets))
            cell = owned[boxes.array].astype(np.int64)
            distances = mesh.coordinates(cell, points[point]) / np.linalg.norm(mesh.gradients_in(cell), axis=2)
            inside = (distances >= -slack).all(axis=1)
            np.minimum.at(found, point[inside], cell[inside])
    source.comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MIN)
    found[found == outside] = -1
    return found


def nearest_material(mesh: LevelMesh, points: np.ndarray, bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The material of a level at points: the cell that contains a point or, where the level's body ends short of it,
    that of the nearest point on the body's boundary. Not collective.

    Parameters
    ----------
    points : (k, d) [m], rest positions
    bodies : (k,) int, the bodies that they belong to

    Returns
    -------
    cells : (k,) int64
    weights : (k, d + 1) float64
        Barycentric coordinates, none negative, rows sum to one.
    """
    cells = containing_cells(points, bodies, LevelSpace(mesh, MPI.COMM_SELF))
    cells, places = behind_nearest_facets(mesh, points, bodies, cells)
    return cells, inner_weights(mesh, cells, places)


def behind_nearest_facets(
    mesh: LevelMesh, points: np.ndarray, bodies: np.ndarray, cells: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Home cells (k,) of points (k, d), where those that are -1 become the cell behind the nearest boundary facet of
    the point's body; and the place (k, d) in the body that is nearest to each point.
    """
    cells, places = cells.copy(), points.copy()
    for body in np.unique(bodies[cells < 0]):
        outside = np.flatnonzero((cells < 0) & (bodies == body))
        facets = np.flatnonzero(mesh.bodies[mesh.boundary_cells] == body)
        facet, places[outside] = nearest_points(mesh.points, mesh.boundary[facets], points[outside])
        cells[outside] = mesh.boundary_cells[facets[facet]]
    return cells, places


def inner_weights(mesh: LevelMesh, cells: np.ndarray, places: np.ndarray) -> np.ndarray:
    """(k, d + 1): barycentric coordinates of places (k, d) in or on cells (k,), without what round-off leaves below
    zero; rows sum to one.
    """
    weights = mesh.coordinates(cells, places).clip(0.0)
    return weights / weights.sum(axis=1, keepdims=True)
