"""The prolongation P from a coarse to a fine level: scalar weights in input order, and the PETSc matrix of the
distributed spaces.
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from petsc4py import PETSc
from scipy.sparse.linalg import svds

from pdvol.levels.binding import Binding
from pdvol.levels.interpolants import Interpolant
from pdvol.levels.interpolants.barycentric import barycentric
from pdvol.levels.space import LevelSpace


class Prolongation:
    """P from `coarse` to `fine`, linear, the same for every component. Construction is collective.

    Rows sum to one and rest positions go to rest positions.

    The marches, the metrics and the coarse space of the linear solver use `weights`, mostly through
    `prolong_positions`: they hold whole states in input order, and the same product on every number of ranks gives the
    same digits. `matrix`, `prolong` and `restrict` are for PETSc vectors, in code of the user's own and for Galerkin
    products; pdvol itself does not need them, so the matrix is assembled at first use.

    Attributes
    ----------
    weights : (n_fine, n_coarse) scipy.sparse.csr_matrix
        In input order, replicated.
    """

    def __init__(self, coarse: LevelSpace, fine: LevelSpace, binding: Binding, interpolant: Interpolant = barycentric):
        self.coarse, self.fine, self.binding = coarse, fine, binding
        self.weights = interpolant(coarse, fine, binding)

    @cached_property
    def matrix(self) -> PETSc.Mat:
        """P as an AIJ matrix with block size d: rows laid out as the fine space's vectors, columns as the coarse
        space's. First use is collective.
        """
        return _assemble(self.weights, self.coarse, self.fine)

    def prolong(self, coarse: PETSc.Vec, fine: PETSc.Vec) -> None:
        """fine = P coarse. Collective."""
        self.matrix.mult(coarse, fine)

    def restrict(self, fine: PETSc.Vec, coarse: PETSc.Vec) -> None:
        """coarse = P' fine: the coarse forces that do the same work as fine ones. Collective."""
        self.matrix.multTranspose(fine, coarse)

    def prolong_positions(self, positions: np.ndarray) -> np.ndarray:
        """(n_fine, d) from (n_coarse, d), both whole and in input order. Not collective."""
        return self.weights @ positions

    @cached_property
    def two_norm(self) -> float:
        """||P||_2, to four digits."""
        if min(self.weights.shape) < 8:
            return float(np.linalg.norm(self.weights.toarray(), 2))
        start = np.ones(min(self.weights.shape))
        return float(svds(self.weights, k=1, tol=1e-4, v0=start, return_singular_vectors=False)[0])

    def report(self) -> dict:
        """The binding's report, and what bounds the growth of extrapolated motion (paper, appendix on negative
        weights).

        `weights_per_point` is the mean number of coarse points that a fine one depends on. `frobenius_norm` of the
        scalar weights is at most `sqrt_points` (root of the number of fine points) for barycentric ones where nothing
        is extrapolated.
        """
        return {
            **self.binding.report(),
            "largest_weight": float(np.abs(self.weights.data).max()),
            "weights_per_point": self.weights.nnz / self.weights.shape[0],
            "frobenius_norm": float(sp.linalg.norm(self.weights)),
            "sqrt_points": float(np.sqrt(self.weights.shape[0])),
            "two_norm": self.two_norm,
        }


def _assemble(weights: sp.csr_matrix, coarse: LevelSpace, fine: LevelSpace) -> PETSc.Mat:
    d = fine.dim
    rows = weights[fine.owned_points].tocoo()
    blocks = sp.csr_matrix((rows.data, (rows.row, coarse.point_blocks[rows.col])), shape=rows.shape)
    owned = sp.kron(blocks, sp.eye(d), format="csr")
    owned.sort_indices()
    sizes = ((fine.n_owned * d, weights.shape[0] * d), (coarse.n_owned * d, weights.shape[1] * d))
    csr = (owned.indptr.astype(PETSc.IntType), owned.indices.astype(PETSc.IntType), owned.data)
    matrix = PETSc.Mat().createAIJ(sizes, bsize=d, csr=csr, comm=fine.comm)
    matrix.assemble()
    return matrix
