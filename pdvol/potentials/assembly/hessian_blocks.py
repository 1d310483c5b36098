"""The sum of the terms' Hessians: d x d blocks of this rank's rows, on or right of the diagonal.

The sparsity pattern of a level's Hessian from its cells: upper triangle, in blocks. Built once per level.
"""

import numpy as np
from petsc4py import PETSc
from scipy.sparse import bsr_array, csr_array

from pdvol.levels.space import LevelSpace

# code of block s that is added transposed: TRANSPOSED - s, as elements.c decodes it
TRANSPOSED = -2
# code of a block in another rank's rows, which is not added
ELSEWHERE = -1
# treatment of negative eigenvalues: its number in the C code (`mode` in elements.c and isotropic.c)
FILTERS = {"none": 0, "clamp": 1, "abs": 2}


class BlockPattern:
    """Blocks (d x d) in this rank's rows, on or right of the diagonal, in global block numbering.

    Attributes
    ----------
    rows, columns : (count,) int64
        Local row and global column of each block, sorted.
    starts : (n_owned + 1,)
        Where each row's blocks begin.
    diagonal : (n_owned,)
        Which blocks lie on the diagonal.
    slots : (m_near, (d + 1)(d + 2) / 2) int32
        Block index of each pair i <= j of a near cell's vertices, with the codes above for blocks that are added
        transposed or not stored.
    """

    def __init__(self, space: LevelSpace):
        self.space = space
        d, n = space.dim, len(space.mesh.points)
        i, j = np.triu_indices(d + 1)
        blocks = space.local_blocks[space.near_dofs]
        row, column = np.minimum(blocks[:, i], blocks[:, j]), np.maximum(blocks[:, i], blocks[:, j])
        stored = (row >= space.first_block) & (row < space.first_block + space.n_owned)
        keys = (row - space.first_block) * n + column
        unique, slot = np.unique(keys[stored], return_inverse=True)
        slots = np.full(keys.shape, ELSEWHERE, dtype=np.int64)
        slots[stored] = np.where((blocks[:, i] > blocks[:, j])[stored], TRANSPOSED - slot, slot)
        self.slots = np.ascontiguousarray(slots, dtype=np.int32)
        self.keys, self.rows, self.columns = unique, unique // n, unique % n
        self.starts = np.searchsorted(unique, np.arange(space.n_owned + 1) * n).astype(PETSc.IntType)
        self.diagonal = np.searchsorted(
            unique, np.arange(space.n_owned) * n + space.first_block + np.arange(space.n_owned)
        )

    @property
    def count(self) -> int:
        return len(self.keys)


class HessianBlocks:
    """A symmetric matrix being summed, of which this rank holds its rows' upper triangle.

    Attributes
    ----------
    pattern : BlockPattern
    projection : "clamp", "abs" or "none"
        Negative eigenvalues of the terms' local Hessians are set to zero, replaced by their absolute values, or kept.
    cells : (pattern.count, d, d)
        Blocks between vertices of a cell, in the pattern's order.
    added : list of (rows, columns, blocks)
        The contributions of `add_pairs`, rows local.
    """

    def __init__(self, pattern: BlockPattern, projection: str = "clamp"):
        self.pattern, self.projection = pattern, projection
        d = pattern.space.dim
        self.cells = np.zeros((pattern.count, d, d))
        self.added: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def clear(self) -> None:
        """Back to zero."""
        self.cells[:] = 0.0
        self.added.clear()

    def finite(self) -> bool:
        """Whether all blocks of this rank are finite."""
        return bool(np.isfinite(self.cells.sum())) and all(np.isfinite(blocks.sum()) for *_, blocks in self.added)

    def add_diagonal(self, vertices: np.ndarray, blocks: np.ndarray) -> None:
        """Adds blocks (k, d, d) on the diagonal at owned vertices (k,), which may repeat."""
        np.add.at(self.cells, self.pattern.diagonal[vertices], blocks)

    def add_masses(self, masses: np.ndarray) -> None:
        """Adds a diagonal matrix, given by its entries (n_owned, d)."""
        d = masses.shape[1]
        self.cells[self.pattern.diagonal[:, None], np.arange(d), np.arange(d)] += masses

    def add_pairs(self, rows: np.ndarray, columns: np.ndarray, blocks: np.ndarray) -> None:
        """Adds blocks (k, d, d) at global block indices (k,), which may repeat. Both triangles may be given: only
        blocks in this rank's rows, on or right of the diagonal, are kept.
        """
        first, last = self.pattern.space.first_block, self.pattern.space.first_block + self.pattern.space.n_owned
        kept = (rows >= first) & (rows < last) & (columns >= rows)
        if not kept.any():
            return
        if kept.all():
            self.added.append((rows - first, columns, blocks))
        else:
            self.added.append((rows[kept] - first, columns[kept], blocks[kept]))

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """The contributions of `add_pairs`, summed by place: keys (k,) = local row * n + global column, ascending, and
        blocks (k, d, d).
        """
        d, n = self.pattern.space.dim, len(self.pattern.space.mesh.points)
        if not self.added:
            return np.zeros(0, dtype=np.int64), np.zeros((0, d, d))
        keys = np.concatenate([row * n + column for row, column, _ in self.added])
        blocks = np.concatenate([blocks for _, _, blocks in self.added])
        keys, order = sorted_keys(keys)
        first = np.flatnonzero(np.diff(keys, prepend=-1))
        return keys[first], np.add.reduceat(blocks[order], first, axis=0)

    def to_csr(self) -> csr_array:
        """The whole symmetric matrix (n d, n d), in PETSc's numbering, of a level on one rank."""
        d, n = self.pattern.space.dim, len(self.pattern.space.mesh.points)
        keys, blocks = self.pairs()
        keys, blocks = np.concatenate([self.pattern.keys, keys]), np.concatenate([self.cells, blocks])
        order = np.argsort(keys, kind="stable")
        keys, blocks = keys[order], blocks[order]
        starts = np.searchsorted(keys, np.arange(n + 1) * n)
        upper = csr_array(bsr_array((blocks, keys % n, starts), shape=(n * d, n * d)).tocsr())
        upper.sum_duplicates()
        diagonal = np.flatnonzero(keys // n == keys % n)
        across = csr_array(
            bsr_array(
                (blocks[diagonal], keys[diagonal] % n, np.searchsorted(keys[diagonal], np.arange(n + 1) * n)),
                shape=(n * d, n * d),
            ).tocsr()
        )
        across.sum_duplicates()
        return csr_array(upper + upper.T - across)


def sorted_keys(keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The keys (k,) >= 0 in ascending order, and the stable permutation that sorts them.

    Sorting values is several times faster than argsort. Each key therefore carries its index in its low bits, where 63
    bits suffice for both.
    """
    bits = len(keys).bit_length()
    if int(keys.max()).bit_length() + bits > 63:
        order = np.argsort(keys, kind="stable")
        return keys[order], order
    packed = np.sort((keys << bits) | np.arange(len(keys)))
    return packed >> bits, packed & ((1 << bits) - 1)
