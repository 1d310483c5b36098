"""The sparsity of a level's cells in blocks, and the way from a rank's blocks to its matrix rows. Built once per level."""

import numpy as np
from petsc4py import PETSc
from scipy.sparse import bsr_array, csr_array

from pdvol.hierarchy.level_space import LevelSpace


class BlockPattern:
    """Blocks (d x d) that couple the vertices of a cell, in local numbering.

    Attributes
    ----------
    slots : (m_local, (d + 1)^2) int32
        Which block each pair of a cell's vertices adds to.
    count : int
        Number of blocks on this rank, ghost rows included.
    """

    def __init__(self, space: LevelSpace):
        self.space = space
        dofs = np.asarray(space.V.dofmap.list, dtype=np.int64)
        n = len(space.local_points)
        corners = dofs.shape[1]
        keys = np.repeat(dofs, corners, axis=1) * n + np.tile(dofs, (1, corners))
        unique, inverse = np.unique(keys, return_inverse=True)
        self.slots = np.ascontiguousarray(inverse.reshape(keys.shape), dtype=np.int32)
        self.count = len(unique)
        self._columns = (unique % n).astype(np.int32)
        self._starts = np.searchsorted(unique, np.arange(n + 1) * n).astype(np.int32)
        self._distributed = None

    def rows(self, blocks: np.ndarray) -> csr_array:
        """This rank's matrix rows (n_owned d, n d), in PETSc's columns, from blocks (count, d, d). Collective."""
        space, d = self.space, self.space.dim
        n_global = len(space.mesh.points) * d
        if space.comm.size == 1:
            return csr_array(bsr_array((blocks, self._columns, self._starts), shape=(n_global, n_global)).tocsr())
        matrix = self._distributed = self._distributed or self._create()
        matrix.zeroEntries()
        matrix.setValuesBlockedLocalCSR(self._starts, self._columns, blocks, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.assemble()
        starts, columns, values = matrix.getValuesCSR()
        return csr_array((values, columns, starts), shape=(space.n_owned * d, n_global))

    def _create(self) -> PETSc.Mat:
        """A distributed matrix that takes rows of ghosts and hands them to their owners."""
        space, d = self.space, self.space.dim
        size = (space.n_owned * d, len(space.mesh.points) * d)
        matrix = PETSc.Mat().create(comm=space.comm)
        matrix.setSizes((size, size), bsize=d)
        matrix.setType(PETSc.Mat.Type.AIJ)
        index_map = space.V.dofmap.index_map
        blocks = index_map.local_to_global(np.arange(len(space.local_points), dtype=np.int32)).astype(PETSc.IntType)
        ghosts = PETSc.LGMap().create(blocks, bsize=d, comm=space.comm)
        matrix.setLGMap(ghosts, ghosts)
        matrix.setUp()
        return matrix
