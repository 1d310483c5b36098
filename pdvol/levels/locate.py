"""Which cell of a distributed level contains a point, and the barycentric coordinates of points in cells.

A point is in a cell when its signed distance to every facet's plane is at least `-FACET_TOLERANCE * size`, `size` being
the largest coordinate of the level. On a shared facet the lowest input cell index wins, so the answer does not depend
on the number of ranks.
"""

import numpy as np
from dolfinx import geometry
from mpi4py import MPI
from scipy.spatial import cKDTree

from pdvol.geometry.boundary_search import nearest_points
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.space import LevelSpace

# share of the largest coordinate: above the coordinates' round-off, far below any gap in a mesh
FACET_TOLERANCE = 1e-12
# points searched at a time: bounds the memory of the candidate pairs
CHUNK = 20_000
# cells, by their centres, among which the one nearest to a point is sought: many times those around one vertex
NEAREST_CENTRES = 128


def containing_cells(points: np.ndarray, bodies: np.ndarray, source: LevelSpace) -> np.ndarray:
    """The cell of `source` that contains each point, among the cells of the point's own body. Collective.

    Every rank searches the cells it owns (`dolfinx.geometry.bb_tree`); the lowest input index found by any rank is
    taken.

    Parameters
    ----------
    points : (n, d) float64 [m]
        Replicated on all ranks.
    bodies : (n,) int
    source : LevelSpace

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
            inside = _contains(mesh.points[mesh.cells[cell]], points[point], slack)
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
    found = np.zeros(len(points), dtype=np.int64)
    weights = np.zeros((len(points), mesh.dim + 1))
    for body in np.unique(bodies):
        mine, own = np.flatnonzero(bodies == body), np.flatnonzero(mesh.bodies == body)
        facets = mesh.bodies[mesh.boundary_cells] == body
        facet, nearest = nearest_points(mesh, mesh.boundary[facets], points[mine])
        behind = mesh.boundary_cells[facets][facet]
        centres = cKDTree(mesh.points[mesh.cells[own]].mean(axis=1))
        _, near = centres.query(points[mine], k=np.arange(1, min(NEAREST_CENTRES, len(own)) + 1))
        tried = np.repeat(points[mine], near.shape[1], axis=0)
        within = barycentric_coordinates(tried, mesh.points[mesh.cells[own[near.ravel()]]]).reshape(*near.shape, -1)
        best, each = within.min(axis=2).argmax(axis=1), np.arange(len(mine))
        outside = within[each, best].min(axis=1) < 0.0
        found[mine] = np.where(outside, behind, own[near[each, best]])
        weights[mine] = within[each, best]
        at_surface = barycentric_coordinates(nearest[outside], mesh.points[mesh.cells[behind[outside]]]).clip(0.0)
        weights[mine[outside]] = at_surface / at_surface.sum(axis=1, keepdims=True)
    return found, weights


def barycentric_coordinates(points: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Barycentric coordinates (n, d + 1) of points (n, d) in simplices with corners (n, d + 1, d). Rows sum to one; may
    be negative.
    """
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    others = np.linalg.solve(edges, (points - corners[:, 0])[..., None])[..., 0]
    return np.column_stack([1.0 - others.sum(axis=1), others])


def _contains(corners: np.ndarray, points: np.ndarray, slack: float) -> np.ndarray:
    """(n,) bool: the point's distance to the plane of every facet, counted positive inwards, is at least -slack."""
    gradients = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    # A product and a sum, not einsum or matmul: a pair's result must not depend on its place in the array, which
    # differs between ranks.
    coordinates = (gradients * (points - corners[:, 0])[:, None, :]).sum(axis=2)
    coordinates[:, 0] += 1.0
    return (coordinates >= -slack * np.sqrt((gradients**2).sum(axis=2))).all(axis=1)
