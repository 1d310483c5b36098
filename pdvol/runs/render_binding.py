"""The weights by which a surface that is drawn follows a body's level: positions of its vertices are W x.

Its vertices are at home in cells of the level (`surface_homes.py`). Vertices at one place are bound as one, so that
a surface which its author has cut along the seams of a texture stays closed.

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
from pdvol.geometry.halved_cells import halved_cells
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.binding import INSIDE, Binding, bind
from pdvol.levels.interpolants.phong import vertex_gradients
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTERPOLANTS
from pdvol.runs.surface_homes import nearest_homes

OF_POINTS = ("barycentric", "phong")
"""Interpolants that need nothing of what they carry but its points."""
MOST_HALVED = 60_000
"""Vertices of a level's cells cut into eight, up to which biharmonic coordinates take minutes and some GB."""


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
    inner = carry(source, between, bind(between, source))
    return sp.csr_matrix(bind(places, between).matrix(between.mesh) @ inner)
