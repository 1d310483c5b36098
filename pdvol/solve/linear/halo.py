"""What ranks exchange in products with a symmetric matrix, of which each holds the rows of its vertices."""

from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import SPARE, BlockCsr, room_of_rows
from pdvol.potentials.assembly.native import pointer
from pdvol.solve.linear import native


class Halo:
    """The couplings of this rank's vertices with those of others, and the callbacks of the compiled loop.

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
    exchange, sum : C callbacks
    """

    def __init__(self, space: LevelSpace, rows: BlockCsr, last: "Halo | None" = None):
        self._comm, d, first, n = space.comm, space.dim, space.first_block, space.n_owned
        count = len(rows[1])
        self._parts: list[BlockCsr] = last._parts if last is not None else []
        if not self._parts or count > len(self._parts[0][1]):
            self._parts = [room_of_rows(n, 2 * count, d) for _ in range(2)]
        self.own, (starts, columns, blocks) = _split(rows, d, first, self._parts)
        row = np.repeat(np.arange(n), np.diff(starts))
        ghosts, ghost = np.unique(columns, return_inverse=True)
        self.far = starts, ghost.astype(np.int32), blocks
        # Whose vertices are ghosts here has this rank's coupled vertices as ghosts, in the same order.
        owners = lambda blocks: np.searchsorted(space.rank_ends, blocks, side="right")
        ranks = len(space.rank_ends)
        pairs = np.unique(owners(columns) * n + row)
        self._rows, self._counts = pairs % max(n, 1), d * np.bincount(pairs // max(n, 1), minlength=ranks)
        self._ghosts = d * np.bincount(owners(ghosts), minlength=ranks)
        self._d, self._count, self.values = d, n, np.zeros((len(ghosts), d))
        self.exchange = native.ffi.callback("void(const double *, double *)", self._exchange)
        self.sum = native.ffi.callback("void(double *, int32_t)", self._sum)

    def _exchange(self, own: Any, far: Any) -> None:
        vector = np.frombuffer(native.ffi.buffer(own, self._count * 32)).reshape(-1, 4)
        self._comm.Alltoallv(
            [np.ascontiguousarray(vector[self._rows, : self._d]), self._counts], [self.values, self._ghosts]
        )

    def _sum(self, numbers: Any, count: int) -> None:
        self._comm.Allreduce(MPI.IN_PLACE, np.frombuffer(native.ffi.buffer(numbers, count * 8)), op=MPI.SUM)


def _split(rows: BlockCsr, d: int, first: int, parts: list[BlockCsr]) -> tuple[BlockCsr, BlockCsr]:
    """What couples the vertices from `first` on, whose rows these are, in their own numbers; and what couples them with
    others, with global columns. Both are in the memory of `parts`.
    """
    n = len(rows[0]) - 1
    kinds = "int32_t", "int32_t", "double"
    given = [pointer(array, kind) for part in (rows, *parts) for array, kind in zip(part, kinds, strict=True)]
    native.library().split_rows(d, n, first, *given)
    found = []
    for begin, at, values in parts:
        end = int(begin[n])
        values[end * d * d :][:SPARE] = 0.0
        found.append((begin, at[:end], values[: end * d * d].reshape(end, d, d)))
    return found[0], found[1]
