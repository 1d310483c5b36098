"""Where the vertices of a detailed surface are at home in a body: their cells, and the points of the body nearest by.

As in `geodesic.py`, what lies outside is bound along the surface's own edges, so that it never gets to another branch
of the body that is near by chance: a ray along an edge that meets the body's boundary gives a vertex its facet. That
rule alone would bind all of a large area outside of the body to the few facets at its rim. Here neighbours hand their
facet on, layer by layer, and each vertex walks from it over facets with a common corner as long as these are nearer.
"""

import numpy as np
import scipy.sparse as sp

from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.geometry.nearest_in_simplex import nearest_coordinates
from pdvol.levels.binding import CLOSEST, INSIDE, NEIGHBOUR, RAY, Binding
from pdvol.levels.geodesic import ray_hits, vertex_adjacency
from pdvol.levels.locate import containing_cells, inner_weights
from pdvol.levels.space import LevelSpace

NEARER = 1e-9
"""Share by which the square of a distance must become smaller for a walk to go on: above its round-off."""


def nearest_homes(target: LevelMesh, source: LevelSpace) -> Binding:
    """The point of a body that is nearest to each vertex of a surface, as a binding without negative weights. A vertex
    inside is that point itself. Not collective.

    Parameters
    ----------
    target : triangles (k, 3) in 3D, all of body 0
    source : body 0 alone
    """
    mesh, n = source.mesh, len(target.points)
    cells = containing_cells(target.points, np.zeros(n, dtype=np.int32), source)
    kind = np.full(n, INSIDE, dtype=np.int8)
    outside = np.flatnonzero(cells < 0)
    places = target.points.copy()
    if len(outside):
        search = BoundarySearch(mesh, 0)
        walk = _Walk(mesh)
        facet, kind[outside] = _bind_outside(target, outside, search, walk)
        cells[outside] = search.cells[facet]
        places[outside] = walk.nearest(target.points[outside], facet)[0]
    return Binding(cells, kind, inner_weights(mesh, cells, places))


def _bind_outside(
    target: LevelMesh, outside: np.ndarray, search: BoundarySearch, walk: "_Walk"
) -> tuple[np.ndarray, np.ndarray]:
    """Facet (k,) and kind (k,) of the outside vertices."""
    points, edges = target.points, vertex_adjacency(target)
    facet = np.full(len(points), -1, dtype=np.int64)
    kind = np.full(len(points), NEIGHBOUR, dtype=np.int8)
    hits = ray_hits(outside, points, edges, search)
    layer = np.array(list(hits), dtype=np.int64)
    facet[layer], kind[layer] = np.array(list(hits.values()), dtype=np.int64), RAY
    links = edges[outside][:, outside].tocoo()
    ends = outside[links.row], outside[links.col]
    facet[layer] = walk.descend(points[layer], facet[layer])
    for _ in range(len(outside)):
        from_bound = (facet[ends[0]] < 0) & (facet[ends[1]] >= 0)
        layer, which = np.unique(ends[0][from_bound], return_index=True)
        if len(layer) == 0:
            break
        given = facet[ends[1][from_bound][which]]
        facet[layer] = walk.descend(points[layer], given)
        left = facet[ends[0]] < 0
        ends = ends[0][left], ends[1][left]
    alone = outside[facet[outside] < 0]  # parts that meet the body nowhere
    if len(alone):
        facet[alone], kind[alone] = search.closest(points[alone]), CLOSEST
    return facet[outside], kind[outside]


class _Walk:
    """The boundary facets of a body, and which of them have a common corner."""

    def __init__(self, mesh: LevelMesh):
        facets = mesh.boundary
        self._corners = mesh.points[facets]
        rows = np.repeat(np.arange(len(facets)), facets.shape[1])
        has = sp.csr_array((np.ones(len(rows), dtype=np.int32), (rows, facets.ravel())))
        self._beside = sp.csr_array(has @ has.T)

    def nearest(self, points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The nearest point (n, 3) of a facet to each point, and the square of its distance."""
        corners = self._corners[facets]
        places = np.einsum("nc,ncd->nd", nearest_coordinates(points, corners), corners)
        return places, ((points - places) ** 2).sum(axis=1)

    def descend(self, points: np.ndarray, facets: np.ndarray) -> np.ndarray:
        """(n,) the facets at which walks from `facets` (n,) end: none beside them is nearer."""
        facets = facets.copy()
        squares = self.nearest(points, facets)[1]
        walking = np.arange(len(points))
        for _ in range(len(self._corners)):
            if len(walking) == 0:
                break
            fan = self._beside[facets[walking]]
            starts, which = fan.indptr[:-1], np.repeat(walking, np.diff(fan.indptr))
            found = self.nearest(points[which], fan.indices)[1]
            least = np.minimum.reduceat(found, starts)
            # The first facet that has it, of each fan.
            where = np.flatnonzero(found == np.repeat(least, np.diff(fan.indptr)))
            _, one = np.unique(which[where], return_index=True)
            nearer = least < squares[walking] * (1.0 - NEARER)
            facets[walking[nearer]] = fan.indices[where[one]][nearer]
            squares[walking[nearer]] = least[nearer]
            walking = walking[nearer]
        return facets
