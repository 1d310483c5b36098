"""What ranks exchange in products with a symmetric matrix, of which each holds its rows' upper triangle."""

from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.levels.space import LevelSpace
from pdvol.potentials.assembly.hessian_blocks import SPARE, BlockCsr
from pdvol.solve.linear import native


class Halo:
    """The couplings with other ranks' vertices, each on both ranks, and the callbacks of the compiled loop.

    Construction is collective.

    Parameters
    ----------
    space : LevelSpace
    rows : BlockCsr
        This rank's rows, on or right of the diagonal.

    Attributes
    ----------
    own : BlockCsr
        Blocks between this rank's vertices, in its own numbers.
    far : BlockCsr
        Blocks between this rank's vertices and others', these numbered from 0.
    values : (ghosts, d)
        What the others have sent of a vector.
    exchange, sum : C callbacks
    """

    def __init__(self, space: LevelSpace, rows: BlockCsr):
        self._comm, d, first, n = space.comm, space.dim, space.first_block, space.n_owned
        starts, columns, blocks = rows
        ends = np.cumsum(self._comm.allgather(n))
        row = np.repeat(np.arange(n), np.diff(starts))
        inside = columns < first + n
        self.own = _csr(n, row[inside], columns[inside] - first, blocks[inside])
        row, columns, blocks = row[~inside], columns[~inside], blocks[~inside]
        # The owner of a column gets the transposed block; columns by rank are in order only within a row.
        to = np.searchsorted(ends, columns, side="right")
        order = np.argsort(to, kind="stable")
        counts = np.bincount(to, minlength=len(ends))
        places = self._sent(np.stack([columns, row + first], axis=1)[order].astype(np.int64), counts)
        row = np.concatenate([row, places[:, 0] - first])
        columns = np.concatenate([columns, places[:, 1]])
        blocks = np.concatenate([blocks, self._sent(blocks[order].transpose(0, 2, 1), counts)])
        ghosts, ghost = np.unique(columns, return_inverse=True)
        order = np.lexsort((ghost, row))
        self.far = _csr(n, row[order], ghost[order], blocks[order])
        # Whose vertices are ghosts here has this rank's coupled vertices as ghosts, in the same order.
        pairs = np.unique(np.searchsorted(ends, columns, side="right") * n + row)
        self._rows, self._counts = pairs % n if n else pairs, d * np.bincount(pairs // max(n, 1), minlength=len(ends))
        self._ghosts = d * np.bincount(np.searchsorted(ends, ghosts, side="right"), minlength=len(ends))
        self._d, self._count, self.values = d, n, np.zeros((len(ghosts), d))
        self.exchange = native.ffi.callback("void(const double *, double *)", self._exchange)
        self.sum = native.ffi.callback("void(double *, int32_t)", self._sum)

    def _sent(self, entries: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """Entries (k, ...) that all ranks send here, of which this one sends `counts` to each, in order of ranks."""
        parts = np.split(np.ascontiguousarray(entries), np.cumsum(counts)[:-1])
        return np.concatenate(self._comm.alltoall(parts))

    def _exchange(self, own: Any, far: Any) -> None:
        vector = np.frombuffer(native.ffi.buffer(own, self._count * 32)).reshape(-1, 4)
        self._comm.Alltoallv(
            [np.ascontiguousarray(vector[self._rows, : self._d]), self._counts], [self.values, self._ghosts]
        )

    def _sum(self, numbers: Any, count: int) -> None:
        self._comm.Allreduce(MPI.IN_PLACE, np.frombuffer(native.ffi.buffer(numbers, count * 8)), op=MPI.SUM)


def _csr(n: int, rows: np.ndarray, columns: np.ndarray, blocks: np.ndarray) -> BlockCsr:
    """Block CSR of blocks (k, d, d) in ascending local rows (k,)."""
    padded = np.concatenate([blocks.ravel(), np.zeros(SPARE)])
    starts = np.searchsorted(rows, np.arange(n + 1)).astype(np.int32)
    return starts, columns.astype(np.int32), padded[: blocks.size].reshape(blocks.shape)
