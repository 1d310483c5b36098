"""The matrix of Newton's systems: symmetric, in d x d blocks, with supported rows eliminated and a pattern that changes
with the contacts; and what ranks exchange in products with it, since each holds the rows of its own vertices.
"""

from types import SimpleNamespace

import numpy as np
from mpi4py import MPI

from pdvol.compat import PETSc
from pdvol.compiled import ffi, integers, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import SPARE, BlockCsr, HessianBlocks, pointers
from pdvol.solve.callbacks import weakly
from pdvol.solve.linear.halo import Halo, Overlap


class SystemMatrix:
    """The sum of `HessianBlocks`, for compiled products; PETSc's matrix is made of it where it is asked for.

    Parameters
    ----------
    supported : (n_owned,) bool
        Vertices whose rows and columns are the identity's.
    general : whether `petsc` is a general AIJ matrix, which every preconditioner supports

    Attributes
    ----------
    rows : BlockCsr
        Of the last assembly, on or right of the diagonal or in columns of lower ranks, with global columns.
    all_supported : (n,) bool, in PETSc's block order
    compiled : linear_system *
        For the functions of native/, without a preconditioner.
    own : BlockCsr
        The rows' blocks between this rank's vertices, in its own numbers.
    shell : PETSc.Mat
        Multiplies by the last assembly; the same object for ever.
    """

    def __init__(self, space: LevelSpace, supported: np.ndarray, general: bool = False):
        self.space, self._general = space, general
        self._sizes = ((space.n_owned * space.dim, len(space.mesh.points) * space.dim),) * 2
        self.support(supported)
        self.rows: BlockCsr
        self.own: BlockCsr
        self.compiled = ffi.new("linear_system *", {"count": space.n_owned})
        self._factor = np.zeros(0, dtype=np.float32)
        self._factor_starts = np.zeros(space.n_owned + 1, dtype=np.int32)
        self._factor_columns = np.zeros(0, dtype=np.int32)
        self._halo: Halo | None = None
        self._overlap: Overlap | None = None
        self._petsc: PETSc.Mat = None
        self._blocked: PETSc.Mat = None
        self._pattern: tuple[np.ndarray, np.ndarray] | None = None
        context = SimpleNamespace(mult=weakly(self._multiply))
        self.shell = PETSc.Mat().createPython(self._sizes, context, comm=space.comm)
        self.shell.setUp()

    def support(self, supported: np.ndarray) -> None:
        """Sets which vertices (n_owned,) are supported, for the next assembly. Collective."""
        everything = self.space.to_input(supported[:, None])[:, 0] > 0
        self.all_supported: np.ndarray = everything[np.argsort(self.space.point_blocks)]

    def assemble(self, blocks: HessianBlocks, eliminate: bool = True) -> None:
        """Sums `blocks`; `eliminate` makes rows and columns of supported vertices the identity's. Collective."""
        self.rows = self.own = blocks.merged(self.all_supported if eliminate else None)
        self._petsc = None
        if self.space.comm.size > 1:
            self._halo = Halo(self.space, self.compiled, self.rows, self._halo)
            self._overlap = Overlap(self.space, self.compiled, self._halo, self._overlap)
            self.own = self._halo.own
        else:
            self.compiled.own = pointers(self.own)[0]

    def factor_incompletely(self, drop: float = 0.0) -> int:
        """Makes the incomplete Cholesky factor that `compiled` then names: of `own` and the vertices of other ranks
        that are strongly coupled with it, without blocks whose size is below `drop` times that of the diagonal blocks
        beside them. Returns the number of tries (`incomplete_cholesky`).
        """
        compiled, d, count = self.compiled, self.space.dim, len(self.own[1])
        if self._overlap is not None:
            count += len(self._overlap.rows[1])
        if len(self._factor_columns) < count:
            self._factor = np.empty(2 * count * d * d + SPARE, dtype=np.float32)
            self._factor_columns = np.empty(2 * count, dtype=np.int32)
        rows = compiled.count + compiled.others
        if len(self._factor_starts) <= rows:
            self._factor_starts = np.zeros(rows + compiled.others + 1, dtype=np.int32)
        compiled.factor = pointer(self._factor, "float")
        compiled.factor_starts, compiled.factor_columns = integers(self._factor_starts, self._factor_columns)
        tries = library[self.space.dim].incomplete_cholesky(compiled, drop)
        self._factor[self._factor_starts[rows] * d * d :][:SPARE] = 0.0
        return tries

    def solve(
        self, right: np.ndarray, tolerance: float, most: int, start: np.ndarray | None = None
    ) -> tuple[np.ndarray, int, int]:
        """Conjugate gradients with the preconditioner that `compiled` names (`conjugate_gradients` in native/).

        Parameters
        ----------
        right : (n_owned d,)
        tolerance : share of the right side that the residual may have, both measured by the preconditioner
        most : iterations allowed
        start : (n_owned d,) where to begin; zero without it

        Returns the solution (n_owned d,), PETSc's reason, and the number of iterations. Collective.
        """
        found, count = np.zeros(len(right)), ffi.new("int32_t *")
        begin = ffi.NULL if start is None else pointer(start)
        reason = library[self.space.dim].conjugate_gradients(
            self.compiled, pointer(right), begin, tolerance, most, pointer(found), count
        )
        if reason == 0:  # NO_MEMORY: to PETSc this is a solve that still goes on
            raise MemoryError("no memory left for conjugate gradients")
        return found, reason, count[0]

    def _multiply(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = A x, by `shell`. Collective."""
        library[self.space.dim].symmetric_product(
            self.compiled, pointer(x.getArray(readonly=True)), pointer(y.getArray())
        )

    @property
    def _upper(self) -> BlockCsr:
        """`rows` without what is left of the diagonal."""
        starts, columns, blocks = self.rows
        if self.space.comm.size == 1:
            return self.rows
        row = np.repeat(np.arange(self.space.n_owned), np.diff(starts))
        kept = columns >= row + self.space.first_block
        return np.concatenate([[0], np.cumsum(kept)])[starts], columns[kept], blocks[kept]

    @property
    def petsc(self) -> PETSc.Mat:
        """The last assembly as PETSc's own matrix, SBAIJ or AIJ, made at the first call after it. Collective.

        An unchanged pattern keeps the object, and with it what solvers derived from the pattern.
        """
        if self._petsc is None:
            starts, columns, blocks = (array.copy() for array in self._upper)
            known = self._pattern is not None and all(map(np.array_equal, self._pattern, (starts, columns)))
            known = self.space.reduce(known, MPI.LAND)
            csr = (starts.astype(PETSc.IntType), columns.astype(PETSc.IntType), blocks)
            if known:
                self._blocked.setValuesBlockedCSR(*csr)
                self._blocked.assemble()
            else:
                self._pattern = (starts, columns)
                self._blocked = PETSc.Mat().createSBAIJ(self._sizes, self.space.dim, csr=csr, comm=self.space.comm)
                self._blocked.assemble()
                self._blocked.setOption(PETSc.Mat.Option.SPD, True)
            self._petsc = self._blocked
            if self._general:
                self._petsc = self._blocked.convert("aij", PETSc.Mat())  # one that is converted again is not symmetric
                self._petsc.setOption(PETSc.Mat.Option.SPD, True)
        return self._petsc
