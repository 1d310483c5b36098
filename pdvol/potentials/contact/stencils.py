"""Contact pairs as arrays: the vertices that a pair joins and their coefficients.

The gap vector of a pair is g = sum_i c_i x_i over up to four vertices, its distance is |g|. With constant coefficients
the distance's gradient is exact, because closest points are stationary. A Hessian made with constant coefficients and a
constant normal leaves out the force times the distance's own curvature. For a barrier that part is mostly negative, and
a projection to positive definite matrices would remove it anyway.
"""

from dataclasses import dataclass
from operator import attrgetter

import ipctk
import numpy as np

from pdvol.geometry.closest_points import along, closest, closest_of_parts, inside
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks

# kind of the nearest parts of two edges: their interiors. ipctk makes other kinds pairs of vertices or edges instead,
# except between nearly parallel edges.
INTERIORS = ipctk.EdgeEdgeDistanceType.EA_EB


@dataclass(frozen=True)
class Stencils:
    """k contact pairs. A pair with fewer than four vertices repeats its first one, with coefficient zero.

    Attributes
    ----------
    vertices : (k, 4) int64
        Indices into the collision mesh.
    coefficients : (k, 4)
    weights : (k,)
        Area [m^(d-1)], or count, times the mollifier of nearly parallel edges.
    has_normal : (k,) bool
        Whether the contact has a definite normal. Nearly parallel edges have none: their closest points may be
        anywhere along them.
    owned : (k,) bool
        Whether this rank owns the pair. Every rank with a vertex of a pair holds it; sums over all ranks take it from
        its owner.
    """

    vertices: np.ndarray
    coefficients: np.ndarray
    weights: np.ndarray
    has_normal: np.ndarray
    owned: np.ndarray

    def gaps(self, positions: np.ndarray) -> np.ndarray:
        """(k, d) gap vectors [m] at positions (n, d) of the collision mesh."""
        return np.einsum("ki,kid->kd", self.coefficients, positions[self.vertices])

    def objects_in_contact(self, objects: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The two objects, (k,) each, that touch in each pair, from the object (n,) of each vertex. They are equal
        where a body touches itself.

        The first vertex of a pair lies on one side. The other side is the first among the other vertices' objects that
        differs from it.
        """
        first, *others = objects[self.vertices].T
        second = others[-1]
        for candidate in others[-2::-1]:
            second = np.where(candidate != first, candidate, second)
        return first, second

    def scatter(self, forces: np.ndarray, count: int) -> np.ndarray:
        """(count, d) forces [N] at the collision mesh's vertices, from forces (k, d) on the gaps: the transpose of
        `gaps`.
        """
        out = np.empty((count, forces.shape[1]))
        for axis in range(forces.shape[1]):
            out[:, axis] = np.bincount(
                self.vertices.ravel(), (self.coefficients * forces[:, axis, None]).ravel(), minlength=count
            )
        return out

    def add(self, gap_hessian: np.ndarray, blocks: np.ndarray, into: HessianBlocks) -> None:
        """Adds the pairs' Hessians over the positions, c_i c_j M for the vertices i, j of a pair.

        Parameters
        ----------
        gap_hessian : (k, d, d) [N/m]
            Symmetric: M, the Hessian of each pair's energy over its gap vector.
        blocks : (m,) int
            Global block index of the first m of the collision mesh's vertices. The other vertices are obstacles'.
        into : HessianBlocks
        """
        joined = (self.coefficients != 0.0) & (self.vertices < len(blocks))
        rows = blocks[np.where(joined, self.vertices, 0)]
        one, other = np.triu_indices(4)
        pair, which = np.nonzero(joined[:, one] & joined[:, other])
        one, other = one[which], other[which]
        a, b = rows[pair, one], rows[pair, other]
        shares = self.coefficients[pair, one] * self.coefficients[pair, other]
        into.add_pairs(np.minimum(a, b), np.maximum(a, b), shares[:, None, None] * gap_hessian[pair])


def normal_stencils(
    active: ipctk.NormalCollisions, edges: np.ndarray, faces: np.ndarray, positions: np.ndarray
) -> Stencils:
    """The active pairs of a collision mesh as stencils.

    Parameters
    ----------
    active : ipctk.NormalCollisions
    edges : (e, 2) int64
    faces : (f, 3) int64
    positions : (n, d) [m]
        At which `active` was built.
    """
    vv = columns(active.vv_collisions, "vertex0_id", "vertex1_id", "weight")
    ev = columns(active.ev_collisions, "edge_id", "vertex_id", "weight")
    fv = columns(active.fv_collisions, "face_id", "vertex_id", "weight")
    edge_edge = active.ee_collisions
    ee = columns(edge_edge, "edge0_id", "edge1_id", "weight", "eps_x")
    first, second = zip(*(pairs[:, :2].astype(np.int64).T for pairs in (vv, ev, fv, ee)), strict=True)
    edge, face, one, other = edges[first[1]], faces[first[2]], edges[first[3]], edges[second[3]]
    corners = lambda primitives: positions[primitives].transpose(1, 0, 2)
    mollifiers = _mollifier(positions[one], positions[other], ee[:, 3])
    s, t = closest(*corners(one), *corners(other))
    mollified = np.flatnonzero(mollifiers < 1.0)
    kinds = np.fromiter((edge_edge[pair].dtype.value for pair in mollified), dtype=np.int64, count=len(mollified))
    ends, kinds = mollified[kinds != INTERIORS.value], kinds[kinds != INTERIORS.value]
    if len(ends):
        (a, b), (c, d) = corners(one[ends]), corners(other[ends])
        s[ends], t[ends] = closest_of_parts(a, b, c, d, kinds)
    parts = [
        _vertex_vertex(first[0], second[0]),
        _edge_vertex(edge, second[1], along(positions[second[1]], *corners(edge))),
        _face_vertex(face, second[2], inside(positions[second[2]], positions[face])),
        _edge_edge(one, other, s, t),
    ]
    vertices, coefficients = (np.concatenate([part[i] for part in parts]) for i in range(2))
    weights = np.concatenate([pairs[:, 2] for pairs in (vv, ev, fv, ee)])
    share = np.ones(len(weights))
    share[len(weights) - len(ee) :] = mollifiers
    owned = np.ones(len(weights), dtype=bool)
    return Stencils(vertices.astype(np.int64), coefficients, weights * share, share == 1.0, owned)


def _vertex_vertex(first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and coefficients (k, 4) of pairs of vertices."""
    zero = np.zeros(len(first))
    return np.column_stack([first, second, first, first]), np.column_stack([zero + 1.0, zero - 1.0, zero, zero])


def _edge_vertex(edge: np.ndarray, point: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of vertices and edges (k, 2), with the closest point at the share t (k,) of the edge."""
    return np.column_stack([point, edge, point]), np.column_stack([np.ones(len(t)), t - 1.0, -t, np.zeros(len(t))])


def _face_vertex(face: np.ndarray, point: np.ndarray, uv: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of vertices and faces (k, 3), with the closest point at coordinates uv (k, 2)."""
    u, v = uv.T
    return np.column_stack([point, face]), np.column_stack([np.ones(len(u)), u + v - 1.0, -u, -v])


def _edge_edge(one: np.ndarray, other: np.ndarray, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The same of pairs of edges (k, 2), with the closest points at the shares s and t (k,)."""
    return np.column_stack([one, other]), np.column_stack([1.0 - s, s, t - 1.0, -t])


def _mollifier(one: np.ndarray, other: np.ndarray, eps: np.ndarray) -> np.ndarray:
    """(k,) factors in [0, 1] of pairs of edges, zero where they are parallel (Li et al. 2020, section 4.2).

    `one` and `other` (k, 2, 3) are their corners, `eps` (k,) [m^4] the squared cross product below which they count as
    nearly parallel.
    """
    if len(eps) == 0:
        return eps
    cross = np.cross(one[:, 1] - one[:, 0], other[:, 1] - other[:, 0])
    share = np.einsum("kd,kd->k", cross, cross) / eps
    return np.where(share < 1.0, (2.0 - share) * share, 1.0)


def column(pairs: list, name: str, kind: type = float) -> np.ndarray:
    """(k,) one attribute of k pairs."""
    return np.fromiter(map(attrgetter(name), pairs), dtype=kind, count=len(pairs))


def columns(pairs: list, *names: str) -> np.ndarray:
    """(k, names) several attributes of k pairs, as floats."""
    return np.column_stack([column(pairs, name) for name in names])
