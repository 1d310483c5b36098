"""The prolongation P from a coarse to a fine level: a PETSc matrix on the distributed vectors of both."""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import svds

from pdvol.compat import PETSc
from pdvol.levels.binding import Binding
from pdvol.levels.interpolants import Interpolant
from pdvol.levels.interpolants.barycentric import barycentric
from pdvol.levels.space import LevelSpace


class Prolongation:
    """P from `coarse` to `fine`, linear, the same for every component. Construction is collective.

    Rows sum to one and rest positions go to rest positions.

    Attributes
    ----------
    matrix : PETSc.Mat
        AIJ with block size d: rows laid out as the fine space's vectors, columns as the coarse space's. Its transpose
        is the restriction, which gives the coarse forces that do the same work as fine ones.
    """

    def __init__(self, coarse: LevelSpace, fine: LevelSpace, binding: Binding, interpolant: Interpolant = barycentric):
        self.coarse, self.fine, self.binding = coarse, fine, binding
        self.matrix = _assemble(interpolant(coarse, fine, binding), coarse, fine)
        self._coarse_vector, self._fine_vector = self.matrix.createVecs()

    def prolong(self, values: np.ndarray) -> np.ndarray:
        """P times positions or velocities: (n_fine, d) from (n_coarse, d), in input order, on all ranks. Collective."""
        self._coarse_vector.array[:] = self.coarse.from_input(values).ravel()
        self.matrix.mult(self._coarse_vector, self._fine_vector)
        return self.fine.to_input(self._fine_vector.array.reshape(-1, self.fine.dim))

    def weights(self) -> sp.csr_array:
        """P of one component (n_fine, n_coarse), in input order and on every rank. Collective."""
        return input_weights(self.matrix, self.coarse, self.fine)

    @cached_property
    def two_norm(self) -> float:
        """||P||_2, to four digits. First use is collective."""
        weights = self.weights()
        if min(weights.shape) < 8:
            return float(np.linalg.norm(weights.toarray(), 2))
        return float(svds(weights, k=1, tol=1e-4, v0=np.ones(min(weights.shape)), return_singular_vectors=False)[0])

    def report(self) -> dict:
        """The binding's report, and what bounds the growth of extrapolated motion (paper, appendix on negative
        weights). Collective.

        `weights_per_point` is the mean number of coarse points that a fine one depends on. `frobenius_norm` of the
        weights of one component is at most `sqrt_points` (root of the number of fine points) for barycentric ones where
        nothing is extrapolated.
        """
        weights = self.weights()
        return {
            **self.binding.report(),
            "largest_weight": float(np.abs(weights.data).max()),
            "weights_per_point": weights.nnz / weights.shape[0],
            "frobenius_norm": float(sp.linalg.norm(weights)),
            "sqrt_points": float(np.sqrt(weights.shape[0])),
            "two_norm": self.two_norm,
        }


def input_weights(matrix: PETSc.Mat, coarse: LevelSpace, fine: LevelSpace) -> sp.csr_array:
    """A component (n_fine, n_coarse) of a matrix from `coarse` to `fine`, in input order, on all ranks. Collective."""
    starts, columns, values = matrix.getValuesCSR()
    rows = sp.csr_array((values, columns, starts), shape=(matrix.getLocalSize()[0], matrix.getSize()[1]))
    whole = sp.vstack(fine.comm.allgather(rows[:: fine.dim, :: fine.dim]), format="csr")
    weights = sp.csr_array(whole[fine.point_blocks][:, coarse.point_blocks])
    weights.sort_indices()
    return weights


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
