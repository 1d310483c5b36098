"""Contact pairs as arrays: which vertices a pair joins, with which coefficients, for Hessians that need nothing else.

A pair's gap is |sum_i c_i x_i| over up to four vertices. Holding the coefficients, its gradient is exact (closest
points are stationary); the Hessians made of it leave out how normal and closest points turn, which is what a projection
to positive definite ones mostly cuts off anyway: for a barrier, force times the gap's own curvature.
"""

from dataclasses import dataclass

import ipctk
import numpy as np

from pdvol.geometry.closest_points import along, closest, closest_of_parts, inside
from pdvol.potentials.assembly.hessian_blocks import HessianBlocks
from pdvol.potentials.contact.pair_arrays import columns

# ipctk hands out the nearest parts of two edges as a pair of their own where they are not the insides, but for edges
# that are nearly parallel.
INSIDE = ipctk.EdgeEdgeDistanceType.EA_EB


@dataclass(frozen=True)
class Stencils:
    """Contact pairs. Unused places of pairs with fewer than four vertices repeat the first one, with coefficient zero.

    Attributes
    ----------
    vertices : (k, 4) int64, into the collision mesh
    coefficients : (k, 4)
    weights : (k,), mollifiers included
    oblique : (k,) bool
        Whether the direction of contact is certain: not so between nearly parallel edges, which may touch elsewhere.
    counted : (k,) bool
        Whether this rank counts the pair where sums run over all ranks: others have it, too, if it has vertices of
        theirs.
    """

    vertices: np.ndarray
    coefficients: np.ndarray
    weights: np.ndarray
    oblique: np.ndarray
    counted: np.ndarray

    def gaps(self, positions: np.ndarray) -> np.ndarray:
        """(k, d) vectors from one side to the other."""
        return np.einsum("ki,kid->kd", self.coefficients, positions[self.vertices])

    def sides(self, parties: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Who touches whom: (k,) each, from the parties (n,) that vertices belong to. The first vertex is one side's,
        whichever pair it is; the first of the others that is not of the same party is the other side's, and there is
        none where a party touches itself.
        """
        first, *others = parties[self.vertices].T
        second = others[-1]
        for party in others[-2::-1]:
            second = np.where(party != first, party, second)
        return first, second

    def gather(self, forces: np.ndarray, count: int) -> np.ndarray:
        """Sum over pairs of C' f (count, d) at vertices, from f (k, d): the transpose of `gaps`."""
        out = np.empty((count, forces.shape[1]))
        for axis in range(forces.shape[1]):
            out[:, axis] = np.bincount(
                self.vertices.ravel(), (self.coefficients * forces[:, axis, None]).ravel(), minlength=count
            )
        return out

    def add(self, middle: np.ndarray, blocks: np.ndarray, into: HessianBlocks) -> None:
        """Adds sum_k C_k' M_k C_k, where C_k maps positions to gaps and M (k, d, d) is symmetric.

        Parameters
        ----------
        middle : (k, d, d)
        blocks : (m,) global block index of the first m of the collision mesh's vertices; the others are obstacles'
        """
        joined = (self.coefficients != 0.0) & (self.vertices < len(blocks))
        rows = blocks[np.where(joined, self.vertices, 0)]
        one, other = np.triu_indices(4)
        pair, which = np.nonzero(joined[:, one] & joined[:, other])
        one, other = one[which], other[which]
        a, b = rows[pair, one], rows[pair, other]
        shares = self.coefficients[pair, one] * self.coefficients[pair, other]
        into.add_pairs(np.minimum(a, b), np.maximum(a, b), shares[:, None, None] * middle[pair])


def normal_stencils(
    active: ipctk.NormalCollisions, edges: np.ndarray, faces: np.ndarray, positions: np.ndarray
) -> Stencils:
    """The active pairs of a collision mesh at `positions` (n, d)."""
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
    ends, kinds = mollified[kinds != INSIDE.value], kinds[kinds != INSIDE.value]
    if len(ends):
        s[ends], t[ends] = closest_of_parts(*corners(one[ends]), *corners(other[ends]), kinds)
    parts = [
        _vertex_vertex(first[0], second[0]),
        _edge_vertex(edge, second[1], along(positions[second[1]], *corners(edge))),
        _face_vertex(face, second[2], inside(positions[second[2]], positions[face])),
        _edge_edge(one, other, s, t),
    ]
    vertices, coefficients = (np.concatenate([part[i] for part in parts]) for i in range(2))
    weights = np.concatenate([pairs[:, 2] for pairs in (vv, ev, fv, ee)])
    counted = np.ones(len(weights))
    counted[len(weights) - len(ee) :] = mollifiers
    return Stencils(
        vertices.astype(np.int64), coefficients, weights * counted, counted == 1.0, np.ones(len(weights), dtype=bool)
    )


def _vertex_vertex(first, second):
    zero = np.zeros(len(first))
    return np.column_stack([first, second, first, first]), np.column_stack([zero + 1.0, zero - 1.0, zero, zero])


def _edge_vertex(edge, point, t):
    return np.column_stack([point, edge, point]), np.column_stack([np.ones(len(t)), t - 1.0, -t, np.zeros(len(t))])


def _face_vertex(face, point, uv):
    u, v = uv.T
    return np.column_stack([point, face]), np.column_stack([np.ones(len(u)), u + v - 1.0, -u, -v])


def _edge_edge(one, other, s, t):
    return np.column_stack([one, other]), np.column_stack([1.0 - s, s, t - 1.0, -t])


def _mollifier(one, other, eps) -> np.ndarray:
    """How much of a pair of edges counts as they become parallel (Li et al. 2020, section 4.2)."""
    if len(eps) == 0:
        return eps
    cross = np.cross(one[:, 1] - one[:, 0], other[:, 1] - other[:, 0])
    share = np.einsum("kd,kd->k", cross, cross) / eps
    return np.where(share < 1.0, (2.0 - share) * share, 1.0)
