"""Home cells for points outside the source mesh, found along the target's own edges (paper 3.3.2 and 3.3.3).

Points are taken in order of most bound neighbours, ties by lowest index. The closest facet hit by a ray along an
incident edge, within the edge, gives the home. Without a hit the closest of the neighbours' home facets does.

A neighbour bound by a ray or by its neighbours has one home facet. A neighbour inside the source has none; its segment
to a point outside crosses the boundary, so the ray decides, except where the two meshes touch to round-off. There its
home facets are the boundary facets of the first layer of cells, counted through shared facets from its home cell, that
has any: reached through the source's material, hence on the same branch.
"""

import heapq
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import scipy.sparse as sp

from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.geometry.level_mesh import LevelMesh

INSIDE, RAY, NEIGHBOUR, CLOSEST, ISLAND = range(5)


def bind_outside(
    target: LevelMesh, source: LevelMesh, cells: np.ndarray, rays: bool = True
) -> tuple[np.ndarray, np.ndarray]:
    """Complete a binding whose inside points are known. Not collective; the result depends on the arguments only.

    Parameters
    ----------
    cells : (n,) int64
        Home cell of each target point, -1 where it is outside.
    rays : whether rays along edges are cast; neighbours alone decide otherwise

    Returns
    -------
    cells : (n,) int64
        Without -1.
    kind : (n,) int8
        INSIDE, RAY, NEIGHBOUR; CLOSEST for the points of a connected part of the target without any bound point, which
        go to the Euclidean-closest cell of their body.
    """
    cells = cells.copy()
    kind = np.full(len(cells), INSIDE, dtype=np.int8)
    edges, material = vertex_adjacency(target), _Material(source)
    bodies = target.point_bodies
    for body in np.unique(bodies[cells < 0]):
        outside = np.flatnonzero((cells < 0) & (bodies == body))
        search = BoundarySearch(source, body)
        hits = ray_hits(outside, target.points, edges, search) if rays else {}
        facet, kind[outside] = _march(outside, target.points, edges, cells, search, material, hits)
        cells[outside] = search.cells[facet]
    return cells, kind


def vertex_adjacency(mesh: LevelMesh) -> sp.csr_array:
    """Which points share an edge: (n, n), sorted columns, without the diagonal. Cells may be triangles in 3D."""
    pairs = np.concatenate([mesh.cells[:, pair] for pair in combinations(range(mesh.cells.shape[1]), 2)])
    ones = np.ones(len(pairs), dtype=np.int8)
    upper = sp.coo_array((ones, (pairs.min(axis=1), pairs.max(axis=1))), shape=(len(mesh.points),) * 2).tocsr()
    upper.data[:] = 1
    adjacency = (upper + upper.T).tocsr()
    adjacency.sort_indices()
    return adjacency


def _march(
    outside: np.ndarray,
    points: np.ndarray,
    edges: sp.csr_array,
    cells: np.ndarray,
    search: BoundarySearch,
    material: "_Material",
    facet: dict[int, int],
) -> tuple[np.ndarray, np.ndarray]:
    """Facet (k,) and kind (k,) of the outside points of one body, from the facets that rays hit."""
    neighbours: dict[int, list[int]] = {
        v: edges.indices[edges.indptr[v] : edges.indptr[v + 1]].tolist() for v in _integers(outside)
    }
    kind: dict[int, int | None] = dict.fromkeys(neighbours)
    bound = {v: sum(u not in kind for u in around) for v, around in neighbours.items()}
    # The middle entry sorts points without a hit and without a bound neighbour behind all others.
    queue = [(-bound[v], bound[v] == 0 and v not in facet, v) for v in neighbours]
    heapq.heapify(queue)
    while queue:
        count, hopeless, v = heapq.heappop(queue)
        if kind[v] is not None or -count != bound[v]:
            continue
        if hopeless:
            break
        if v in facet:
            kind[v] = RAY
        else:
            candidates = set[int]()
            for u in neighbours[v]:
                if u not in kind:
                    candidates.update(material.facets_near(cells[u], search.cells))
                elif kind[u] is not None:
                    candidates.add(facet[u])
            facet[v], kind[v] = search.closest_of(points[v], candidates), NEIGHBOUR
        for u in neighbours[v]:
            if u in kind and kind[u] is None:
                bound[u] += 1
                heapq.heappush(queue, (-bound[u], False, u))
    orphans = np.array([v for v in neighbours if kind[v] is None], dtype=np.int64)
    if len(orphans):
        for v, closest in zip(_integers(orphans), _integers(search.closest(points[orphans])), strict=True):
            facet[v], kind[v] = closest, CLOSEST
    return np.array([facet[v] for v in neighbours], dtype=np.int64), np.array(
        [kind[v] for v in neighbours], dtype=np.int8
    )


def ray_hits(outside: np.ndarray, points: np.ndarray, edges: sp.csr_array, search: BoundarySearch) -> dict[int, int]:
    """The closest facet hit from each outside point along its edges, where there is one."""
    # The rays do not depend on the order in which points are taken: all are cast at once.
    fan = edges[outside]
    start = np.repeat(outside, np.diff(fan.indptr))
    facet, distance = search.first_hits(points[start], points[fan.indices])
    order = np.lexsort((facet, distance, start))
    order = order[facet[order] >= 0]
    vertex, first = np.unique(start[order], return_index=True)
    return dict(zip(_integers(vertex), _integers(facet[order[first]]), strict=True))


def _integers(array: np.ndarray) -> list[int]:
    """An integer array (k,) as a list."""
    numbers: Any = array.tolist()  # numpy's hint has a number, too: it does not know the dimension
    return numbers


class _Material:
    """The source's cells joined through shared facets."""

    def __init__(self, mesh: LevelMesh):
        self._mesh = mesh

    @cached_property
    def _links(self) -> sp.csr_array:
        a, b = self._mesh.inner_facets[0].T
        return sp.csr_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(len(self._mesh.cells),) * 2)

    def facets_near(self, cell: int, facet_cells: np.ndarray) -> list[int]:
        """Boundary facets of the first layer of cells around `cell` that has any; `facet_cells` (k,) are theirs."""
        layer, seen = {int(cell)}, set[int]()
        while layer:
            facets = np.flatnonzero(np.isin(facet_cells, list(layer)))
            if len(facets):
                return _integers(facets)
            seen |= layer
            layer = {
                int(c) for k in layer for c in self._links.indices[self._links.indptr[k] : self._links.indptr[k + 1]]
            } - seen
        return []
