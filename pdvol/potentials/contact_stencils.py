"""Contact pairs as arrays: which vertices a pair joins, with which coefficients, for Hessians that need nothing else.

A pair's gap is |sum_i c_i x_i| over up to four vertices. Holding the coefficients, its gradient is exact (closest points are stationary);
the Hessians made of it leave out how normal and closest points turn, which is what a projection to positive definite ones mostly cuts off
anyway: for a barrier, force times the gap's own curvature.
"""

from dataclasses import dataclass

import ipctk
import numpy as np

from pdvol.potentials.hessian_blocks import HessianBlocks

EDGE_EDGE = 8  # ipctk's distance type of two edges whose closest points lie inside both
PARALLEL = 1e-12  # of the product of two edges' squared lengths: as near to parallel as is divided by


@dataclass(frozen=True)
class Stencils:
    """Contact pairs. Unused places of pairs with fewer than four vertices repeat the first one, with coefficient zero.

    Attributes
    ----------
    vertices : (k, 4) int64, into the collision mesh
    coefficients : (k, 4)
    weights : (k,), mollifiers included
    """

    vertices: np.ndarray
    coefficients: np.ndarray
    weights: np.ndarray

    def gaps(self, positions: np.ndarray) -> np.ndarray:
        """(k, d) vectors from one side to the other."""
        return np.einsum("ki,kid->kd", self.coefficients, positions[self.vertices])

    def gather(self, forces: np.ndarray, count: int) -> np.ndarray:
        """Sum over pairs of C' f (count, d) at vertices, from f (k, d): the transpose of `gaps`."""
        out = np.empty((count, forces.shape[1]))
        for axis in range(forces.shape[1]):
            out[:, axis] = np.bincount(self.vertices.ravel(), (self.coefficients * forces[:, axis, None]).ravel(), minlength=count)
        return out

    def add(self, middle: np.ndarray, blocks: np.ndarray, into: HessianBlocks) -> None:
        """Adds sum_k C_k' M_k C_k, where C_k maps positions to gaps and M (k, d, d) is symmetric.

        Parameters
        ----------
        middle : (k, d, d)
        blocks : (m,) global block index of the first m of the collision mesh's vertices; the others are obstacles'
        """
        joined = self.coefficients != 0.0
        for i in range(4):
            for j in range(i, 4):
                a, b = self.vertices[:, i], self.vertices[:, j]
                used = joined[:, i] & joined[:, j] & (a < len(blocks)) & (b < len(blocks))
                if used.any():
                    row, column = blocks[a[used]], blocks[b[used]]
                    share = (self.coefficients[used, i] * self.coefficients[used, j])[:, None, None]
                    into.add_pairs(np.minimum(row, column), np.maximum(row, column), share * middle[used])


def joined(parts: list[Stencils]) -> Stencils:
    """Several ranks' pairs as one."""
    return Stencils(*(np.concatenate([getattr(part, name) for part in parts]) for name in ("vertices", "coefficients", "weights")))


def normal_stencils(active: ipctk.NormalCollisions, edges: np.ndarray, faces: np.ndarray, positions: np.ndarray) -> Stencils:
    """The active pairs of a collision mesh at `positions` (n, d)."""
    vv = np.array([(c.vertex0_id, c.vertex1_id, c.weight) for c in active.vv_collisions]).reshape(-1, 3)
    ev = np.array([(c.edge_id, c.vertex_id, c.weight) for c in active.ev_collisions]).reshape(-1, 3)
    fv = np.array([(c.face_id, c.vertex_id, c.weight) for c in active.fv_collisions]).reshape(-1, 3)
    ee = np.array([(c.edge0_id, c.edge1_id, c.weight, c.eps_x, int(c.dtype)) for c in active.ee_collisions]).reshape(-1, 5)
    ids = lambda rows: rows[:, :2].astype(int).T  # noqa: E731
    one, other = (positions[edges[side]] for side in ids(ee))
    weights = np.concatenate([vv[:, 2], ev[:, 2], fv[:, 2], ee[:, 2] * _mollifier(one, other, ee[:, 3])])
    return _pairs(ids(vv), ids(ev), ids(fv), ids(ee), ee[:, 4].astype(int), edges, faces, positions, weights)


def tangential_stencils(lagged: ipctk.TangentialCollisions, edges: np.ndarray, faces: np.ndarray, positions: np.ndarray) -> Stencils:
    """The pairs of a friction set lagged at `positions` (n, d), weighted by the largest friction force [N]."""
    vv, ev, fv, ee = lagged.vv_collisions, lagged.ev_collisions, lagged.fv_collisions, lagged.ee_collisions
    forces = np.array([c.mu_s * c.normal_force_magnitude * c.weight for pairs in (vv, ev, fv, ee) for c in pairs])
    ids = lambda pairs, one, other: np.array([(getattr(c, one), getattr(c, other)) for c in pairs], dtype=int).reshape(-1, 2).T  # noqa: E731
    edge_edge = np.full(len(ee), EDGE_EDGE)  # pairs of nearly parallel edges, which may touch elsewhere, have no friction in ipctk
    return _pairs(ids(vv, "vertex0_id", "vertex1_id"), ids(ev, "edge_id", "vertex_id"), ids(fv, "face_id", "vertex_id"),
                  ids(ee, "edge0_id", "edge1_id"), edge_edge, edges, faces, positions, forces)


def _pairs(vv, ev, fv, ee, kinds, edges, faces, positions, weights) -> Stencils:
    """Stencils from the ids of vertex pairs, edges and vertices, faces and vertices, pairs of edges; each (2, k)."""
    corners = lambda primitives: positions[primitives].transpose(1, 0, 2)  # noqa: E731
    edge, face, one, other = edges[ev[0]], faces[fv[0]], edges[ee[0]], edges[ee[1]]
    s, t = _closest(*corners(one), *corners(other), kinds) if len(kinds) else (np.zeros(0), np.zeros(0))
    parts = [_vertex_vertex(*vv), _edge_vertex(edge, ev[1], _along(positions[ev[1]], *corners(edge))),
             _face_vertex(face, fv[1], _inside(positions[fv[1]], positions[face])), _edge_edge(one, other, s, t)]
    vertices, coefficients = (np.concatenate([part[i] for part in parts]) for i in range(2))
    return Stencils(vertices.astype(np.int64), coefficients, weights)


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


def _along(p, a, b) -> np.ndarray:
    """Where the foot of p (k, d) lies between a (0) and b (1), cut off at the ends."""
    edge = b - a
    return np.clip(np.einsum("kd,kd->k", p - a, edge) / np.maximum(np.einsum("kd,kd->k", edge, edge), 1e-300), 0.0, 1.0)


def _inside(p, corners) -> np.ndarray:
    """Coordinates (k, 2) of the foot of p in triangles (k, 3, d), along their first vertex's two edges."""
    e, f, r = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], p - corners[:, 0]
    ee, ef, ff = (np.einsum("kd,kd->k", x, y) for x, y in ((e, e), (e, f), (f, f)))
    re, rf = (np.einsum("kd,kd->k", r, x) for x in (e, f))
    determinant = np.maximum(ee * ff - ef**2, 1e-300)
    return np.column_stack([(ff * re - ef * rf) / determinant, (ee * rf - ef * re) / determinant])


def _closest(a, b, c, d, kind: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Closest points of segments ab and cd, as shares (k,) along each, given which of their parts they lie on (ipctk's distance types)."""
    e, f, r = b - a, d - c, a - c
    ee, ef, ff, er, fr = (np.einsum("kd,kd->k", x, y) for x, y in ((e, e), (e, f), (f, f), (e, r), (f, r)))
    determinant = np.maximum(ee * ff - ef**2, PARALLEL * ee * ff + 1e-300)
    zero, one = np.zeros(len(e)), np.ones(len(e))
    shares = [(zero, zero), (zero, one), (one, zero), (one, one), (_along(c, a, b), zero), (_along(d, a, b), one), (zero, _along(a, c, d)),
              (one, _along(b, c, d)), ((ef * fr - ff * er) / determinant, (ee * fr - ef * er) / determinant)]
    pick = np.arange(len(e))
    return np.array([s for s, _ in shares])[kind, pick], np.array([t for _, t in shares])[kind, pick]


def _mollifier(one, other, eps) -> np.ndarray:
    """How much of a pair of edges counts as they become parallel (Li et al. 2020, section 4.2)."""
    if len(eps) == 0:
        return eps
    cross = np.cross(one[:, 1] - one[:, 0], other[:, 1] - other[:, 0])
    share = np.einsum("kd,kd->k", cross, cross) / eps
    return np.where(share < 1.0, (2.0 - share) * share, 1.0)
