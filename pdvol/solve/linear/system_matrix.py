"""The PETSc matrix of Newton's systems: symmetric and blocked, with supported rows eliminated and a pattern that
changes with the contacts.
"""

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks

BlockCsr = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Blocks of this rank's rows: starts (n_owned + 1,), global columns (k,), blocks (k, d, d)."""
MatrixParts = tuple[BlockCsr, BlockCsr]
"""A matrix as the sum of the blocks of cells and the blocks of contact pairs."""


class SystemMatrix:
    """An SBAIJ matrix (upper triangle in d x d blocks) filled from `HessianBlocks`.

    Contacts change the pattern. A new matrix has the pairs of this assembly and of the last one, and it serves until a
    pair is missing, so that not every change of contacts makes a new matrix. A changed pattern needs a new PETSc
    object: one that is preallocated again can keep its nonzero state, and a preconditioner would then reuse the
    symbolic factor of the old pattern.

    Parameters
    ----------
    space : LevelSpace
    supported : (n_owned,) bool
        Vertices whose rows and columns are the identity's.
    general : bool
        Whether `petsc` is a general AIJ copy, which every preconditioner supports.

    Attributes
    ----------
    petsc : PETSc.Mat
    all_supported : (n,) bool, in PETSc's block order
    parts : MatrixParts
        The last assembly: `petsc` is the sum of both.
    """

    def __init__(self, space: LevelSpace, supported: np.ndarray, general: bool = False):
        self.space, self._supported, self._general = space, supported, general
        self._sizes = ((space.n_owned * space.dim, len(space.mesh.points) * space.dim),) * 2
        self.all_supported = space.to_input(np.repeat(supported[:, None].astype(float), space.dim, axis=1))[:, 0] > 0
        self.all_supported = self.all_supported[np.argsort(space.point_blocks)]  # in PETSc's order
        self._extra: np.ndarray | None = None
        self._recent = np.zeros(0, dtype=np.int64)
        self._pattern: BlockPattern | None = None
        self.petsc: PETSc.Mat = None
        self._blocked: PETSc.Mat = None
        self.parts: MatrixParts

    def _follow(self, pattern: BlockPattern) -> None:
        self._pattern = pattern
        n = len(self.space.mesh.points)
        self._rows = (pattern.starts, pattern.columns.astype(PETSc.IntType))
        touched = self._supported[pattern.rows] | self.all_supported[pattern.columns]
        self._eliminated = np.flatnonzero(touched)
        self._ones = pattern.diagonal[self._supported]
        self._n = n

    def forget(self) -> None:
        """Drops pairs of earlier assemblies from the pattern, because the last digits of a solution depend on it."""
        self._recent = np.zeros(0, dtype=np.int64)
        if self._extra is not None and len(self._extra):
            self._extra = None

    def assemble(self, blocks: HessianBlocks, eliminate: bool = True) -> bool:
        """Fills the matrix from `blocks`, which it may change. Returns whether `petsc` is a new object. Collective.

        With `eliminate` the rows and columns of supported vertices become the identity's.
        """
        if self._pattern is not blocks.pattern:
            self._follow(blocks.pattern)
        keys, values = blocks.pairs()
        if eliminate:
            blocks.cells[self._eliminated] = 0.0
            blocks.cells[self._ones] = np.eye(self.space.dim)
            free = ~(self._supported[keys // self._n] | self.all_supported[keys % self._n])
            keys, values = keys[free], values[free]
        new = self._fit(keys, blocks.pattern.keys)
        matrix = self._blocked
        matrix.zeroEntries()
        matrix.setValuesBlockedCSR(*self._rows, blocks.cells)
        matrix.assemble(PETSc.Mat.AssemblyType.FLUSH)
        starts = np.searchsorted(keys, np.arange(self.space.n_owned + 1) * self._n).astype(PETSc.IntType)
        pairs = (starts, (keys % self._n).astype(PETSc.IntType), values)
        matrix.setValuesBlockedCSR(*pairs, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.assemble()
        if self._general:
            self.petsc = matrix.convert("aij") if new else matrix.convert("aij", self.petsc)
            self.petsc.setOption(PETSc.Mat.Option.SPD, True)
        else:
            self.petsc = matrix
        self.parts = ((*self._rows, blocks.cells), pairs)
        return new

    def _fit(self, keys: np.ndarray, base: np.ndarray) -> bool:
        """Makes a new matrix if the present one lacks one of the pairs on some rank. Returns whether it did.
        Collective.

        Parameters
        ----------
        keys : (k,) of the contact pairs
        base : (m,) of the blocks that cells couple
        """
        needed = keys[~_among(keys, base)]
        fits = self._extra is not None and _among(needed, self._extra).all()
        fits = self.space.comm.allreduce(bool(fits), op=MPI.LAND)
        if not fits:
            self._extra = np.union1d(needed, self._recent)
            everything = np.sort(np.concatenate([base, self._extra]))
            starts = np.searchsorted(everything, np.arange(self.space.n_owned + 1) * self._n).astype(PETSc.IntType)
            d = self.space.dim
            self._blocked = PETSc.Mat().createSBAIJ(
                self._sizes,
                d,
                csr=(starts, (everything % self._n).astype(PETSc.IntType), np.zeros((len(everything), d, d))),
                comm=self.space.comm,
            )
            self._blocked.assemble()
            self._blocked.setOption(PETSc.Mat.Option.SPD, True)
        self._recent = needed
        return not fits


def _among(keys: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Which of the keys (k,) are among the known ones, which ascend."""
    place = np.searchsorted(known, keys)
    return np.append(known, -1)[place] == keys
