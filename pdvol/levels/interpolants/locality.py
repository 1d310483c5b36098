"""From dense weights that decay to sparse ones: small weights are dropped, and affine fields are made exact again.

Each row loses its smallest weights, whose absolute sum is at most `DROPPED`: a field changes by at most that fraction
of its range. The remaining weights are then corrected, per row, by the smallest change (in the sense of least squares)
after which affine fields are exact again. The home cell's corners stay in every row, so that the remaining coarse
vertices never lie in a plane.
"""

from collections.abc import Iterable

import numpy as np
import scipy.sparse as sp

DROPPED = 0.05
_THRESHOLDS = 10.0 ** np.arange(-6.0, -1.9, 0.1)  # tried for each row


def make_local(
    columns: Iterable[np.ndarray], home: sp.csr_matrix, coarse: np.ndarray, fine: np.ndarray
) -> sp.csr_matrix:
    """Sparse weights (n, m), exact on affine fields, from blocks (n, k) of the columns of dense ones.

    Parameters
    ----------
    columns : blocks, from the first column to the last
    home : (n, m) barycentric weights in home cells; only its pattern counts
    coarse, fine : (m, d), (n, d) rest positions [m]
    """
    # Even if all m weights of a row are below this, their sum is a fifth of what may be dropped.
    noise = 0.2 * DROPPED / home.shape[1]
    blocks = [sp.csc_matrix(np.where(np.abs(block) > noise, block, 0.0)) for block in columns]
    weights = sp.hstack(blocks, format="csr")
    return restore_affine(_with_pattern(_drop_small(weights, 0.8 * DROPPED), home), coarse, fine)


def _drop_small(weights: sp.csr_matrix, budget: float) -> sp.csr_matrix:
    """Without each row's smallest weights, of absolute sum at most `budget`."""
    row, size = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr)), np.abs(weights.data)
    smallest_kept = np.zeros(weights.shape[0])
    for threshold in _THRESHOLDS:
        lost = np.bincount(row, size * (size < threshold), minlength=weights.shape[0])
        smallest_kept[lost <= budget] = threshold
    kept = size >= smallest_kept[row]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row[kept], minlength=weights.shape[0]))])
    return sp.csr_matrix((weights.data[kept], weights.indices[kept], indptr), shape=weights.shape)


def _with_pattern(weights: sp.csr_matrix, pattern: sp.csr_matrix) -> sp.csr_matrix:
    """The same weights with explicit zeros where only `pattern` has entries."""
    a, b = weights.tocoo(), pattern.tocoo()
    values, rows, columns = np.r_[a.data, np.zeros(b.nnz)], np.r_[a.row, b.row], np.r_[a.col, b.col]
    return sp.coo_matrix((values, (rows, columns)), shape=weights.shape).tocsr()


def restore_affine(weights: sp.csr_matrix, coarse: np.ndarray, fine: np.ndarray) -> sp.csr_matrix:
    """The closest weights of the same pattern, row by row in least squares, whose rows sum to one and take coarse to
    fine points.

    The coarse vertices of each row must span space.
    """
    row = np.repeat(np.arange(weights.shape[0]), np.diff(weights.indptr))
    reach = np.ptp(coarse, axis=0).max() / len(coarse) ** (1.0 / coarse.shape[1])
    # Relative to the fine point: all that must come out of a row is a one and zeros.
    affine = [np.ones(len(row)), *((coarse[weights.indices] - fine[row]) / reach).T]
    row_sums = lambda values: np.add.reduceat(values, weights.indptr[:-1])
    gram = np.array([[row_sums(a * b) for b in affine] for a in affine]).transpose(2, 0, 1)
    missing = -np.array([row_sums(weights.data * a) for a in affine]).T
    missing[:, 0] += 1.0
    factors = np.linalg.solve(gram, missing[..., None])[..., 0]
    change = sum(factors[row, k] * a for k, a in enumerate(affine))
    restored = sp.csr_matrix(
        (weights.data + change, weights.indices.copy(), weights.indptr.copy()), shape=weights.shape
    )
    restored.eliminate_zeros()
    return restored
