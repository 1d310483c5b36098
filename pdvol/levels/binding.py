"""The home cell of every point of one level in another, and its barycentric coordinates there (paper 3.3.2, 3.3.3).

Where a coarse mesh cuts a curve short, as a coil's, the finer mesh may reach into the coarse cells of the next turn.
Such vertices are inside a cell, so no ray is cast for them: they lie on islands. They show by torn edges. The homes of
the two ends of a torn edge are near each other in space and far apart through the coarse mesh. Edges that are not torn
join vertices to parts. The largest part of each connected component of the level is taken to be bound right. A smaller
part is an island if most of its home cells are home to the largest part, too. Its vertices are bound anew, by their
neighbours' homes.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, dijkstra

from pdvol.errors import MeshError
from pdvol.geometry.level_mesh import LevelMesh, simplex_centres
from pdvol.levels.geodesic import CLOSEST, INSIDE, ISLAND, NEIGHBOUR, RAY, bind_outside, vertex_adjacency
from pdvol.levels.locate import containing_cells
from pdvol.levels.space import LevelSpace

DETOUR = 2.0  # ways along coarse edges over straight ones: meshes without a gap between the two seldom reach 1.5
ROOM = 8_000_000  # distances that are found at a time: 64 MB


@dataclass(frozen=True, eq=False)
class Binding:
    """Target points, in input order, bound to source cells. Replicated on all ranks.

    Attributes
    ----------
    cells : (n,) int64
        Input index of the home cell.
    kind : (n,) int8
        INSIDE, RAY, NEIGHBOUR, ISLAND, or CLOSEST: an orphan.
    weights : (n, d + 1) float64
        Barycentric coordinates in the home cell; rows sum to one, entries of points outside are partly negative.
    """

    cells: np.ndarray
    kind: np.ndarray
    weights: np.ndarray

    def __post_init__(self) -> None:
        for array in (self.cells, self.kind, self.weights):
            array.flags.writeable = False

    def matrix(self, source: LevelMesh) -> sp.csr_matrix:
        """(n, n source points): each row holds a point's barycentric coordinates in its home cell of `source`."""
        n, corners = self.weights.shape
        indptr = np.arange(0, n * corners + 1, corners)
        columns = source.cells[self.cells].ravel()
        # A copy: sorting the columns sorts the values in place, which are the binding's.
        weights = sp.csr_matrix((self.weights.ravel(), columns, indptr), shape=(n, len(source.points)), copy=True)
        weights.sort_indices()
        return weights

    def report(self) -> dict:
        """Counts of points by `kind`, and the `largest_weight` in absolute value."""
        names = ("inside", "ray", "neighbour", "orphans", "islands")
        counts = {name: int(count) for name, count in zip(names, np.bincount(self.kind, minlength=5), strict=True)}
        return {**counts, "largest_weight": float(np.abs(self.weights).max())}


def bind(target: LevelSpace | LevelMesh, source: LevelSpace) -> Binding:
    """Bind every point of `target` to a cell of `source`, of the same body. Collective on the source's communicator.

    The levels may be given either way round. The result does not depend on the number of ranks.

    Raises
    ------
    MeshError
        When `source` lacks a body of `target`, or the dimensions differ; on all ranks, before any communication.
    """
    target = target.mesh if isinstance(target, LevelSpace) else target
    mesh = source.mesh
    _check(target, mesh)
    cells = containing_cells(target.points, target.point_bodies, source)
    # One rank computes it for all: arithmetic on two machines may differ in the last digit, and bindings with it.
    found = rebind_islands(target, mesh, *bind_outside(target, mesh, cells)) if source.comm.rank == 0 else None
    cells, kind = source.comm.bcast(found)
    return Binding(cells, kind, mesh.coordinates(cells, target.points))


def home_cells(target: LevelSpace, source: LevelSpace, binding: Binding) -> np.ndarray:
    """(m,) int64: the source cell that contains each target cell's centre; outside, of its corners' homes the one it is
    least far out of.

    `binding` is the target's points' own. Collective on the source's communicator.
    """
    fine, coarse = target.mesh, source.mesh
    centres = simplex_centres(fine.points, fine.cells)
    homes = containing_cells(centres, fine.bodies, source)
    outside = np.flatnonzero(homes < 0)
    if len(outside):
        choices = binding.cells[fine.cells[outside]]
        corners = np.repeat(centres[outside], fine.dim + 1, axis=0)
        within = coarse.coordinates(choices.ravel(), corners).min(axis=1).reshape(choices.shape)
        homes[outside] = choices[np.arange(len(outside)), within.argmax(axis=1)]
    return homes


def rebind_islands(
    target: LevelMesh, source: LevelMesh, cells: np.ndarray, kind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Home cells (n,) and kinds (n,) of a complete binding, with islands bound anew. Not collective."""
    islands = find_islands(target, source, cells)
    if not islands.any():
        return cells, kind
    anew, _ = bind_outside(target, source, np.where(islands, -1, cells), rays=False)
    return anew, np.where(islands, ISLAND, kind).astype(np.int8)


def find_islands(target: LevelMesh, source: LevelMesh, cells: np.ndarray) -> np.ndarray:
    """(n,) bool: which points of a target with home cells (n,) lie on islands."""
    edges = sp.triu(vertex_adjacency(target)).tocoo()
    pairs = np.stack([edges.row, edges.col], axis=1)
    torn = _torn(target, source, cells, pairs)
    n = len(target.points)
    islands = np.zeros(n, dtype=bool)
    if not torn.any():
        return islands
    graph = lambda which: sp.coo_array((np.ones(len(which)), which.T), shape=(n, n))
    parts, components = (connected_components(graph(which), directed=False)[1] for which in (pairs[~torn], pairs))
    sizes = np.bincount(parts)
    of = np.zeros(len(sizes), dtype=np.int64)
    of[parts] = components
    order = np.lexsort((-sizes, of))
    largest = np.zeros(len(sizes), dtype=bool)
    largest[order[np.unique(of[order], return_index=True)[1]]] = True
    shared = np.zeros(len(source.cells), dtype=bool)
    shared[cells[largest[parts]]] = True
    common = np.bincount(parts, shared[cells])
    return (~largest & (common > 0.5 * sizes))[parts]


def _torn(target: LevelMesh, source: LevelMesh, cells: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """(e,) bool: the edges (e, 2) of a target between whose ends' homes the way through the source is a detour."""
    one, other = source.cells[cells[pairs[:, 0]]], source.cells[cells[pairs[:, 1]]]
    apart = np.flatnonzero(~(one[:, :, None] == other[:, None, :]).any(axis=(1, 2)))
    torn = np.zeros(len(pairs), dtype=bool)
    if len(apart) == 0:
        return torn
    corners: list[np.ndarray] = []
    straight = np.linalg.norm(np.diff(target.points[pairs[apart]], axis=1)[:, 0], axis=1)
    for end in range(2):
        points = pairs[apart, end]
        of_home = source.cells[cells[points]]
        away = np.linalg.norm(source.points[of_home] - target.points[points][:, None], axis=2)
        nearest = away.argmin(axis=1)
        corners.append(of_home[np.arange(len(points)), nearest])
        straight += away[np.arange(len(points)), nearest]
    torn[apart] = _ways(source, corners[0], corners[1], DETOUR * straight) > DETOUR * straight
    return torn


def _ways(source: LevelMesh, starts: np.ndarray, ends: np.ndarray, limits: np.ndarray) -> np.ndarray:
    """(k,) [m] lengths of the shortest ways along edges between vertices (k,); inf where they exceed a limit (k,)."""
    edges = vertex_adjacency(source).tocoo()
    lengths = np.linalg.norm(source.points[edges.row] - source.points[edges.col], axis=1)
    graph = sp.coo_array((lengths, (edges.row, edges.col)), shape=edges.shape).tocsr()
    found = np.asarray(graph[starts, ends]).ravel()  # one edge, which most are apart
    found[(found == 0.0) & (starts != ends)] = np.inf
    far = np.flatnonzero(found > limits)
    unique, which = np.unique(starts[far], return_inverse=True)
    at_once = max(1, ROOM // len(source.points))
    for first in range(0, len(unique), at_once):
        mine = np.flatnonzero((which >= first) & (which < first + at_once))
        ways = dijkstra(graph, indices=unique[first : first + at_once], limit=limits[far[mine]].max())
        found[far[mine]] = ways[which[mine] - first, ends[far[mine]]]
    return found


def _check(target: LevelMesh, source: LevelMesh) -> None:
    if target.dim != source.dim:
        raise MeshError(f"cannot bind a {target.dim}D level to a {source.dim}D level")
    missing = np.setdiff1d(target.bodies, source.bodies)
    if len(missing):
        raise MeshError(
            f"body {missing[0]} has no cells on one of two neighbouring levels: give every level a mesh of every body"
        )


__all__ = ["CLOSEST", "INSIDE", "ISLAND", "NEIGHBOUR", "RAY", "Binding", "bind", "home_cells"]
