"""Vertices of a level that lie in another branch of the coarser level than their neighbours.

Where a coarse mesh cuts a curve short, as a coil's, the finer mesh may reach into the coarse cells of the next turn.
Such vertices are inside a cell, so no ray is cast for them. They show by torn edges. The homes of the two ends of a
torn edge are near each other in space and far apart through the coarse mesh. Edges that are not torn join vertices to
parts. The largest part of each connected component of the level is taken to be bound right. A smaller part is an island
if most of its home cells are home to the largest part, too. Its vertices are bound anew, by their neighbours' homes.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, dijkstra

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.geodesic import ISLAND, bind_outside, vertex_adjacency

DETOUR = 2.0  # ways along coarse edges over straight ones: meshes without a gap between the two seldom reach 1.5
ROOM = 8_000_000  # distances that are found at a time: 64 MB


def rebind_islands(
    target: LevelMesh, source: LevelMesh, cells: np.ndarray, kind: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Home cells (n,) and kinds (n,) of a complete binding, with islands bound anew. Not collective."""
    islands = find_islands(target, source, cells)
    if not islands.any():
        return cells, kind
    rest = np.where(islands, -1, cells)
    anew, _ = bind_outside(target, source, rest, rays=False)
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
