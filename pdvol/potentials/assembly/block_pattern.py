"""The sparsity pattern of a level's Hessian from its cells: upper triangle, in blocks. Built once per level."""

import numpy as np
from petsc4py import PETSc

from pdvol.levels.space import LevelSpace

# code of block s that is added transposed: TRANSPOSED - s, as elements.c decodes it
TRANSPOSED = -2
# code of a block in another rank's rows, which is not added
ELSEWHERE = -1


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
