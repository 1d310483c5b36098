"""The matrix of Newton's systems: symmetric, in d x d blocks, with supported rows eliminated and a pattern that changes
with the contacts; and what ranks exchange in products with it, since each holds the rows of its own vertices.
"""

from typing import Any
from weakref import proxy

import numpy as np
from mpi4py import MPI

from pdvol.compat import PETSc
from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import SPARE, BlockCsr, HessianBlocks, room_of_rows
from pdvol.potentials.assembly.native import pointer
from pdvol.solve.linear import messages, native


class Halo:
    """The couplings of this rank's vertices with those of others, and what ranks exchange for products.

    Construction needs no message: each coupling is on both ranks.

    Parameters
    ----------
    space : LevelSpace
    rows : BlockCsr
        This rank's rows, as `HessianBlocks.merged` gives them.
    last : the halo of the last matrix, whose memory is used again

    Attributes
    ----------
    own : BlockCsr
        Blocks between this rank's vertices, on or right of the diagonal, in its own numbers.
    far : BlockCsr
        Blocks between this rank's vertices and others', these numbered from 0.
    values : (ghosts, d)
        What the others have sent of a vector.
    ranks : ranks_t *
    """

    def __init__(self, space: LevelSpace, rows: BlockCsr, last: "Halo | None" = None):
        d, first, n = space.dim, space.first_block, space.n_owned
        count = len(rows[1])
        self._parts: list[BlockCsr] = last._parts if last is not None else []
        if not self._parts or count > len(self._parts[0][1]):
            self._parts = [room_of_rows(n, 2 * count, d) for _ in range(2)]
        self.own, (starts, columns, blocks) = _split(rows, d, first, self._parts)
        row = np.repeat(np.arange(n), np.diff(starts))
        number = np.full(space.rank_ends[-1], -1, dtype=np.int32)
        number[columns] = 0
        ghosts = np.flatnonzero(number == 0)
        number[ghosts] = np.arange(len(ghosts))
        self.far = starts, number[columns], blocks
        # Whose vertices are ghosts here has this rank's coupled vertices as ghosts, in the same order.
        ranks = len(space.rank_ends)
        owners = np.searchsorted(space.rank_ends, ghosts, side="right")
        coupled = np.zeros((ranks, n), dtype=bool)
        coupled[owners[self.far[1]], row] = True
        self._rows = np.nonzero(coupled)[1].astype(np.int32)
        self.values = np.zeros((len(ghosts), d))
        counts = d * coupled.sum(axis=1), d * np.bincount(owners, minlength=ranks)
        self._counts = [np.asarray(each, dtype=np.int32) for own in counts for each in (own, np.cumsum(own) - own)]
        self.ranks: Any = last.ranks if last is not None else messages.ranks(space.comm)
        self.ranks.rows, self.ranks.row = len(self._rows), pointer(self._rows, "int32_t")
        names = ("counts", "starts", "their_counts", "their_starts")
        for name, array in zip(names, self._counts, strict=True):
            setattr(self.ranks, name, pointer(array, "int32_t"))
        self._sent = np.zeros((len(self._rows), d))
        self.ranks.sent = pointer(self._sent)


class _Context:
    """What PETSc calls for `SystemMatrix.shell`, and keeps: the matrix itself it must not, as `newton._weakly` says."""

    def __init__(self, matrix: "SystemMatrix"):
        self._matrix = matrix

    def mult(self, shell: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        self._matrix.multiply(x, y)


class SystemMatrix:
    """The sum of `HessianBlocks`, for compiled products; PETSc's matrix is made of it where it is asked for.

    Parameters
    ----------
    space : LevelSpace
    supported : (n_owned,) bool
        Vertices whose rows and columns are the identity's.
    general : bool
        Whether `petsc` is a general AIJ matrix, which every preconditioner supports.

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
        everything = space.to_input(np.repeat(supported[:, None].astype(float), space.dim, axis=1))[:, 0] > 0
        self.all_supported = everything[np.argsort(space.point_blocks)]
        self.rows: BlockCsr
        self.own: BlockCsr
        self.compiled = native.ffi.new("linear_system *", {"d": space.dim, "count": space.n_owned})
        self._factor = np.zeros(0, dtype=np.float32)
        self._factor_starts = np.zeros(space.n_owned + 1, dtype=np.int32)
        self._factor_columns = np.zeros(0, dtype=np.int32)
        self._halo: Halo | None = None
        self._far = np.zeros((0, space.dim))
        self._petsc: PETSc.Mat = None
        self._blocked: PETSc.Mat = None
        self._pattern: tuple[np.ndarray, np.ndarray] | None = None
        self.shell = PETSc.Mat().createPython(self._sizes, _Context(proxy(self)), comm=space.comm)
        self.shell.setUp()

    def assemble(self, blocks: HessianBlocks, eliminate: bool = True) -> None:
        """Sums `blocks`; with `eliminate` the rows and columns of supported vertices become the identity's.
        Collective.
        """
        self.rows = self.own = blocks.merged(self.all_supported if eliminate else None)
        self._petsc = None
        system = self.compiled
        if self.space.comm.size > 1:
            self._halo = halo = Halo(self.space, self.rows, self._halo)
            self.own, self._far = halo.own, halo.values
            system.far_starts, system.far_columns, system.far_blocks = pointers(halo.far)
            system.ranks = halo.ranks
        system.starts, system.columns, system.blocks = pointers(self.own)

    def factor_incompletely(self, drop: float = 0.0) -> int:
        """Makes the incomplete Cholesky factor of `own` that `compiled` then names: without blocks whose size is below
        `drop` times that of the diagonal blocks beside them. Returns the number of tries (`incomplete_cholesky`).
        """
        compiled, blocks = self.compiled, self.own[2]
        if len(self._factor) < blocks.size + SPARE:
            self._factor = np.empty(2 * blocks.size + SPARE, dtype=np.float32)
            self._factor_columns = np.empty(2 * len(blocks), dtype=np.int32)
        compiled.factor = pointer(self._factor, "float")
        compiled.factor_starts = pointer(self._factor_starts, "int32_t")
        compiled.factor_columns = pointer(self._factor_columns, "int32_t")
        matrix = (compiled.d, compiled.count, compiled.starts, compiled.columns, compiled.blocks)
        factor = (compiled.factor_starts, compiled.factor_columns, compiled.factor)
        tries = native.library.incomplete_cholesky(*matrix, drop, *factor)
        self._factor[self._factor_starts[-1] * compiled.d**2 :][:SPARE] = 0.0
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
        found, count = np.zeros(len(right)), native.ffi.new("int32_t *")
        begin = native.ffi.NULL if start is None else pointer(start)
        reason = native.library.conjugate_gradients(
            self.compiled, pointer(right), begin, tolerance, most, pointer(self._far), pointer(found), count
        )
        return found, reason, count[0]

    def multiply(self, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """y = A x, by `shell`. Collective."""
        native.library.symmetric_product(
            self.compiled, pointer(x.getArray(readonly=True)), pointer(self._far), pointer(y.getArray())
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


def pointers(rows: BlockCsr) -> tuple[Any, Any, Any]:
    """A block CSR for C, whose arrays must be kept."""
    starts, columns, blocks = rows
    return pointer(starts, "int32_t"), pointer(columns, "int32_t"), pointer(blocks)


def _split(rows: BlockCsr, d: int, first: int, parts: list[BlockCsr]) -> tuple[BlockCsr, BlockCsr]:
    """What couples the vertices from `first` on, whose rows these are, in their own numbers; and what couples them with
    others, with global columns. Both are in the memory of `parts`.
    """
    n = len(rows[0]) - 1
    native.library.split_rows(d, n, first, *pointers(rows), *pointers(parts[0]), *pointers(parts[1]))
    found = []
    for begin, at, values in parts:
        end = int(begin[n])
        values[end * d * d :][:SPARE] = 0.0
        found.append((begin, at[:end], values[: end * d * d].reshape(end, d, d)))
    return found[0], found[1]
