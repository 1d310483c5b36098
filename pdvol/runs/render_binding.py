"""The weights by which a surface that is drawn follows a body's level: positions of its vertices are W x.

Its vertices are at home in cells of the level. Vertices at one place are bound as one, so that a surface which its
author has cut along the seams of a texture stays closed.

As in `geodesic.py`, what lies outside is bound along the surface's own edges, so that it never gets to another branch
of the body that is near by chance: a ray along an edge that meets the body's boundary gives a vertex its facet. That
rule alone would bind all of a large area outside of the body to the few facets at its rim. Here neighbours hand their
facet on, layer by layer, and each vertex walks from it over facets with a common corner as long as these are nearer.

What is extrapolated is seen at once and no solve mends it, so it is extrapolated with care. With Y the body's point
that is nearest to a vertex X, a the interpolant's weights there, and F_j the mean deformation gradients around the
corners of its home cell (`interpolants/phong.py`), of which b_j are the barycentric coordinates of Y,

    x = sum_i a_i x_i  +  sum_j b_j F_j (X - Y).

Inside of the body Y = X. Affine motions are reproduced, as by all interpolants. docs/render_meshes.md has what the rule
of finer levels, the home cell's own gradient, would do.

Interpolants take the points to be carried from a mesh of cells, and a surface has none. Those of `OF_POINTS` look at
its points alone. The others carry the level to its own cells cut into eight, which are then interpolated linearly:
biharmonic coordinates are, in this way, those of Wang et al. (2015) with the level's vertices as handles.
"""

from types import SimpleNamespace
from typing import cast

import numpy as np
import scipy.sparse as sp
from mpi4py import MPI

from pdvol.errors import InputError
from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.geometry.halved_cells import halved_cells
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.geometry.nearest_in_simplex import nearest_coordinates
from pdvol.levels.binding import CLOSEST, INSIDE, NEIGHBOUR, RAY, Binding, bind
from pdvol.levels.geodesic import ray_hits, vertex_adjacency
from pdvol.levels.interpolants.phong import vertex_gradients
from pdvol.levels.locate import containing_cells, inner_weights
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTERPOLANTS

OF_POINTS = ("barycentric", "phong")
"""Interpolants that need nothing of what they carry but its points."""
MOST_HALVED = 60_000
"""Vertices of a level's cells cut into eight, up to which biharmonic coordinates take minutes and some GB."""
NEARER = 1e-9
"""Share by which the square of a distance must become smaller for a walk to go on: above its round-off."""


def render_weights(
    points: np.ndarray, triangles: np.ndarray, first: np.ndarray, body: LevelMesh, interpolant: str, name: str
) -> sp.csr_matrix:
    """W (n, m), rows summing to one, from one body of a level to a surface. Not collective.

    Parameters
    ----------
    points : (n, 3) the surface's vertices, at rest in the scene [m]
    triangles : (k, 3) of them
    first : (n,) the first vertex at each one's place
    body : the body on the level, of m points
    interpolant : a name in `pdvol.registry.INTERPOLANTS`
    name : of the body, for messages

    Raises
    ------
    InputError
        The interpolant cannot be computed for this level.
    """
    kept, index = np.unique(first, return_inverse=True)
    index = index.ravel()
    zeros = lambda count: np.zeros(count, dtype=np.int32)
    corners = index[triangles]
    whole = corners[(corners != np.roll(corners, 1, axis=1)).all(axis=1)]  # poles of spheres have triangles of no area
    at = lambda places: LevelMesh(places, whole, zeros(len(whole)), zeros(len(whole)))
    source = LevelSpace(LevelMesh(body.points, body.cells, zeros(len(body.cells)), body.regions), MPI.COMM_SELF)
    home = nearest_homes(at(points[kept]), source)
    linear = home.matrix(body)
    nearest = linear @ body.points
    weights = _interpolated(source, at(nearest), home, interpolant, name)
    offsets = np.where((home.kind == INSIDE)[:, None], 0.0, points[kept] - nearest)
    for along, gradient in zip(offsets.T, vertex_gradients(body), strict=True):
        weights = weights + sp.diags(along) @ linear @ gradient
    weights.eliminate_zeros()
    return sp.csr_matrix(weights)[index]


def _interpolated(
    source: LevelSpace, places: LevelMesh, binding: Binding, interpolant: str, name: str
) -> sp.csr_matrix:
    """The interpolant's weights at points of the body itself."""
    carry = INTERPOLANTS[interpolant]
    if interpolant in OF_POINTS:
        points_alone = cast(LevelSpace, SimpleNamespace(mesh=places))  # all that they see of a surface
        return sp.csr_matrix(carry(source, points_alone, binding))
    between = LevelSpace(halved_cells(source.mesh), MPI.COMM_SELF)
    if len(between.mesh.points) > MOST_HALVED:
        raise InputError(
            f"{name}: {interpolant} weights of a render mesh need the level's cells cut into eight,"
            f" {len(between.mesh.points):,} vertices, and {MOST_HALVED:,} are the most; take"
            f" RenderMesh(interpolant={OF_POINTS[-1]!r})"
        )
    return sp.csr_matrix(bind(places, between).matrix(between.mesh) @ carry(source, between, bind(between, source)))


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
        facet[layer] = walk.descend(points[layer], facet[ends[1][from_bound][which]])
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
