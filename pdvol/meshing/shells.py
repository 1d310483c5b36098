"""Shells of a surface: its connected parts, and whether they lie inside one another."""

import igl
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pdvol.errors import IntersectionError
from pdvol.geometry.crossings import edges_of

MOST_SHELLS = 300
"""Shells of a surface that are looked at for one inside another: with more it takes minutes."""


def shells(triangles: np.ndarray, n: int) -> np.ndarray:
    """(n,) component of each of `n` vertices under the facets' edges."""
    e = edges_of(triangles)
    return connected_components(coo_array((np.ones(len(e)), (e[:, 0], e[:, 1])), shape=(n, n)), directed=False)[1]


def signed_volumes(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(k,) volume [m^3] of the tetrahedra between each triangle and one of the surface's points."""
    a, b, c = (points[triangles[:, k]] - points[triangles[0, 0]] for k in range(3))
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0


def check_nested(points: np.ndarray, triangles: np.ndarray, name: str) -> None:
    """Raise IntersectionError where a shell lies inside another one and is no cavity of it, or bounds no body."""
    owner = shells(triangles, len(points))[triangles[:, 0]]
    names, first = np.unique(owner, return_index=True)
    if not 1 < len(names) <= MOST_SHELLS:
        return
    volumes = np.bincount(owner, signed_volumes(points, triangles))
    places = points[triangles[first, 0]]
    around = np.zeros(len(names))
    for shell in names:
        mine, others = triangles[owner == shell], np.flatnonzero(names != shell)
        low, high = points[mine].min(axis=(0, 1)), points[mine].max(axis=(0, 1))
        inside = others[((places[others] > low) & (places[others] < high)).all(axis=1)]
        if len(inside):
            corners = np.unique(mine)
            local = np.searchsorted(corners, mine)
            winding = igl.winding_number(points[corners], local, np.ascontiguousarray(places[inside]))
            around[inside] += np.round(winding)
    for shell, volume, deep in zip(names, volumes[names], around, strict=True):
        if deep != (volume < 0):
            vertex = int(triangles[first[shell], 0])
            what = (
                "lies inside another one, so that two bodies overlap; remove it, or turn it inward for a cavity"
                if deep > 0
                else "faces inward, and lies inside no other; turn it outward"
            )
            raise IntersectionError(f"{name}: the shell of vertex {vertex} {what}", [(vertex,)])
