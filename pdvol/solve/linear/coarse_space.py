"""The coarse space of the two-level preconditioner: smooth displacements that a local preconditioner hardly corrects.

Each rank sums the Galerkin operator P' A P (contact included) from its own rows, and every rank factors it. P
interpolates linearly between a coarser level's vertices, or on regular background grids.
"""

from typing import Any

import numpy as np
from mpi4py import MPI
from scipy.linalg.lapack import dpbtrf
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from pdvol.compiled import integers, pointer
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import BlockCsr, pointers

# vertices of grids over the square root of the level's: with twice as many the factor costs what iterations save (of
# 100,000 vertices a quarter fewer iterations, a tenth more time), and with half as many heaps of bodies lose the
# rotations of each
COARSE_VERTICES = 2.0
# points whose weights are found at once: each needs 400 bytes of work room, and a level may have a million
POINTS_AT_ONCE = 65_536
# fraction of the diagonal of P' A P that is added to it: nodes at the boundary can be nearly linearly dependent
COARSE_DIAGONAL_SHIFT = 1e-7


def grid_weights(mesh: LevelMesh) -> csr_array:
    """(n, m) weights of the mesh's n points over the m vertices of background grids. Rows sum to one.

    Each body has a share of the vertices as large as its own share: a grid, or one simplex round the body (which gives
    all affine motions) where a grid would have too many, or a constant.
    """
    n, parts = len(mesh.points), []
    wanted = COARSE_VERTICES * n**-0.5
    columns = 0
    for body in np.unique(mesh.point_bodies):
        points = np.flatnonzero(mesh.point_bodies == body)
        part = _body_weights(mesh.points[points], wanted * len(points)).tocoo()
        parts.append((part.data, points[part.row], part.col + columns))
        columns += part.shape[1]
    weights, rows, nodes = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return csr_array((weights, (rows, nodes)), shape=(n, columns))


def _body_weights(points: np.ndarray, wanted: float) -> csr_array:
    """(n, m) weights of one body's points over about `wanted` vertices, at least one."""
    d = points.shape[1]
    if wanted < d + 1:
        return csr_array(np.ones((len(points), 1)))
    low, size = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-300)
    share = (points - low) / size
    if wanted < 2**d:
        return csr_array(np.column_stack([1.0 - share.sum(axis=1), share]))
    boxes = _boxes(size, wanted)
    weights = _grid(share, boxes)
    # Grid vertices without a point near are left out: a body that fills little of its box gets a finer grid instead.
    finer = _boxes(size, wanted * np.prod(boxes + 1) / weights.shape[1])
    return weights if (finer == boxes).all() else _grid(share, finer)


def _boxes(size: np.ndarray, wanted: float) -> np.ndarray:
    """(d,) numbers of boxes along the sides `size` (d,) of a grid of at most `wanted` vertices; nearly cubes."""
    boxes = np.ones(len(size), dtype=np.int64)
    while True:
        finer = boxes + (np.arange(len(size)) == np.argmax(size / boxes))
        if np.prod(finer + 1) > wanted:
            return boxes
        boxes = finer


def _grid(share: np.ndarray, boxes: np.ndarray) -> csr_array:
    """(n, m) weights of points at `share` (n, d) of the grid's sides, over the m grid vertices that have any.

    Boxes are divided in d! simplices by the order of a point's coordinates within its box (Kuhn). Vertices are
    numbered along the longest side last, which keeps those that cells couple close.
    """
    n, d = share.shape
    columns, weights = np.empty((n, d + 1), dtype=np.int64), np.empty((n, d + 1))
    longest = np.argsort(-boxes)
    for first in range(0, n, POINTS_AT_ONCE):
        some = slice(first, first + POINTS_AT_ONCE)
        scaled = share[some] * boxes
        corner = np.minimum(scaled.astype(np.int64), boxes - 1)
        order = np.argsort(corner - scaled, axis=1)
        inside = np.take_along_axis(scaled - corner, order, axis=1)
        ones = np.ones((len(scaled), 1))
        weights[some] = -np.diff(np.column_stack([ones, inside, 0.0 * ones]), axis=1)
        steps = np.cumsum(np.eye(d, dtype=np.int64)[order], axis=1)
        vertices = corner[:, None] + np.concatenate([np.zeros_like(steps[:, :1]), steps], axis=1)
        columns[some] = np.ravel_multi_index(tuple(np.moveaxis(vertices, 2, 0)[longest]), tuple(boxes[longest] + 1))
    counted = weights > 0.0
    used, nodes = np.unique(columns[counted], return_inverse=True)
    return csr_array((weights[counted], nodes, np.append(0, np.cumsum(counted.sum(axis=1)))), shape=(n, len(used)))


class CoarseSpace:
    """The Galerkin operator P' A P and its factor L L', a band. Construction is collective.

    Parameters
    ----------
    weights : (n, m) sparse
        P of one component, rows in input order.
    supported : (n,) bool, in PETSc's block order
        Vertices whose rows of P are set to zero.

    Attributes
    ----------
    size : number of coarse vertices
    starts, columns, weights : P in PETSc's block order, CSR
    """

    def __init__(self, space: LevelSpace, weights: csr_array, supported: np.ndarray):
        self.space = space
        P = csr_array(csr_array(weights)[np.argsort(space.point_blocks)].multiply(~supported[:, None]))
        P.eliminate_zeros()
        P = csr_array(P[:, np.unique(P.indices)])
        P.sort_indices()
        self.size: int = P.shape[1]
        self.starts, self.columns, self.weights = P.indptr.astype(np.int32), P.indices.astype(np.int32), P.data
        self._places: np.ndarray
        self._band: np.ndarray

    def update(self, rows: BlockCsr) -> bool:
        """Sums and factors P' A P. Returns whether it is positive definite, which it is where A is. Collective.

        Parameters
        ----------
        rows : A of this rank's rows, as `HessianBlocks.merged` gives it
        """
        d, comm = self.space.dim, self.space.comm
        keys, sums = self._own_sum(rows)
        on_diagonal = keys % (self.size + 1) == 0
        sums[on_diagonal] += sums[on_diagonal].transpose(0, 2, 1)
        if comm.size > 1:
            every = np.unique(np.concatenate(comm.allgather(keys)))
            total = np.zeros((len(every), d, d))
            total[np.searchsorted(every, keys)] = sums
            comm.Allreduce(MPI.IN_PLACE, total, op=MPI.SUM)
            keys, sums = every, total
        return self._factored(keys, sums)

    def _factored(self, keys: np.ndarray, blocks: np.ndarray) -> bool:
        """Factors the matrix with the blocks (k, d, d) at keys (k,). Returns whether it is positive definite."""
        d, n = self.space.dim, self.size
        nodes = np.divmod(keys, n)
        graph = csr_array((np.ones(len(keys)), nodes), shape=(n, n))
        order = np.argsort(reverse_cuthill_mckee(graph + graph.T, symmetric_mode=True))
        self._places = order.astype(np.int32)[self.columns]
        i, j = (d * order[ends, None] + np.arange(d) for ends in nodes)
        low, high = np.minimum(i[:, :, None], j[:, None]), np.maximum(i[:, :, None], j[:, None])
        self._band = np.zeros((d * n, 4 * (1 + np.max(high - low) // 4)))
        self._band[low, high - low] = blocks
        self._band[:, 0] *= 1.0 + COARSE_DIAGONAL_SHIFT
        _, failed = dpbtrf(self._band.T, lower=True, overwrite_ab=True)
        return not failed and bool(np.isfinite(self._band[:, 0]).all())

    def _own_sum(self, rows: BlockCsr) -> tuple[np.ndarray, np.ndarray]:
        """Of this rank's rows: the keys i size + j of blocks (k,), i >= j, and the blocks (k, d, d)."""
        d, n = self.space.dim, self.size
        # as many as there can be: pages that stay unused take no memory
        room = min(n * (n + 1) // 2, int(np.diff(self.starts).max()) ** 2 * len(rows[1]))
        keys, sums, places = np.empty(room, np.int64), np.empty((room, d, d)), np.zeros((n, n), np.int32)
        matrix = self.space.n_owned, self.space.first_block, pointers(rows)
        P = *integers(self.starts, self.columns), pointer(self.weights)
        listed = *integers(places), pointer(keys, "int64_t"), pointer(sums)
        count = library[d].coarse_operator(*matrix, *P, n, *listed)
        return keys[:count], sums[:count]

    def give(self, system: Any) -> None:
        """Names the correction to a `linear_system *` of native/; this object has to be kept."""
        first = self.space.first_block
        system.nodes, system.width = self.size, self._band.shape[1]
        system.p_starts, system.p_columns = integers(self.starts[first:], self._places)
        system.p_weights, system.band = pointer(self.weights), pointer(self._band)
