"""What couples a rank's vertices with those of other ranks, what ranks exchange for products with their rows, and the
vertices of others in a rank's incomplete factor.
"""

from typing import Any

import numpy as np

from pdvol.compiled import integers, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import SPARE, BlockCsr, pointers, room_of_rows
from pdvol.solve.linear.messages import Exchange, exchanged

# size of a coupling, over the diagonal block of the vertex, from which on the vertex is in the other rank's factor:
# eight ranks of 20,000 vertices (drop_20k) take 10 per cent more iterations than one, with a quarter more vertices in
# their factors; 20 with 0.25; and 50 with 0.4, where stiff contacts alone are left
STRONG = 0.2


class Halo:
    """The rows of a rank in two parts, and its vertices that are coupled with others'. Both are written into a
    `linear_system *`.

    Construction needs no message: each coupling is on both ranks.

    Parameters
    ----------
    system : linear_system *
    rows : this rank's rows, as `HessianBlocks.merged` gives them
    last : the halo of the last matrix, whose memory is used again

    Attributes
    ----------
    own : BlockCsr
        Blocks between this rank's vertices, on or right of the diagonal, in its own numbers.
    far : BlockCsr
        Blocks between this rank's vertices and others', these numbered from 0 by rank and number.
    rows : (k,) int32
        For each rank, this rank's vertices that are coupled with its, ascending. They are numbered there in this order.
    strong : (k,) uint8
        One where the coupling is strong (`STRONG`).
    counts, their_counts : (ranks,) int32
        Of `rows`, and of each rank's vertices that are coupled with this one's.
    exchange : Exchange
        Of `rows`.
    """

    def __init__(self, space: LevelSpace, system: Any, rows: BlockCsr, last: "Halo | None" = None):
        d, n, ranks = space.dim, space.n_owned, len(space.rank_ends)
        count = len(rows[1])
        self._parts: list[BlockCsr] = last._parts if last is not None else []
        if not self._parts or count > len(self._parts[0][1]):
            self._parts = [room_of_rows(n, 2 * count, d) for _ in range(2)]
        self.own, self.far = _split(rows, d, space.first_block, self._parts)
        system.own, system.far = pointers(self.own)[0], pointers(self.far)[0]
        self._number: np.ndarray = last._number if last is not None else np.full(space.rank_ends[-1], -1, np.int32)
        coupled, strong = np.empty(len(self.far[1]), np.int32), np.empty(len(self.far[1]), np.uint8)
        self.counts, self.their_counts = np.empty((2, ranks), np.int32)
        given = pointer(space.rank_ends, "int64_t"), *integers(self._number)
        found = *integers(coupled), pointer(strong, "uint8_t"), *integers(self.counts, self.their_counts)
        if library[d].border(system, STRONG, ranks, *given, *found) < 0:
            raise MemoryError("no memory left for a rank's border")
        self.rows, self.strong = (each[: self.counts.sum()] for each in (coupled, strong))
        self.exchange: Exchange = last.exchange if last is not None else Exchange(space.comm)
        self.exchange.connect(d, self.rows, self.counts, self.their_counts)
        system.ranks = self.exchange.compiled


class Overlap:
    """The rows that other ranks' vertices add to a factor, and what ranks exchange to solve with it. Both are written
    into a `linear_system *`. Construction is collective.

    It is additive Schwarz with an overlap of one layer. A factor of a rank's own rows loses what couples them with
    others'. Stiff contacts across the border then take twice the iterations, since each side resists what both do
    together. So a rank's factor A_k also has the vertices of others that are strongly coupled with its own. The
    preconditioner is the sum over the ranks k of W A_k^-1 W, in which the squares of the weights W of a vertex sum to
    one over the factors that have it. It is symmetric, unlike restricted additive Schwarz (Cai and Sarkis 1999), which
    weighs on one side. Blocks between vertices of two other ranks are left out: neither of these knows that both are
    here.

    Parameters
    ----------
    system : linear_system *
    halo : of the same matrix
    last : the overlap of the last matrix, whose exchange is used again

    Attributes
    ----------
    rows : BlockCsr
        Couplings of the own vertices with others, which follow behind them, and of these among themselves; with room
        for more.
    weights : (n_owned,) float32
    exchange : Exchange
        Of the vertices in several factors.
    """

    def __init__(self, space: LevelSpace, system: Any, halo: Halo, last: "Overlap | None" = None):
        comm, d, n = space.comm, space.dim, space.n_owned
        starts, coupled = halo.own[0], halo.rows
        room = int((starts[coupled + 1] - starts[coupled]).sum())
        numbers, blocks = np.empty(len(coupled) + room, np.int32), np.empty((room, d, d))
        shared, number = np.empty(len(coupled), np.int32), np.full(n, -1, np.int32)
        sent, came, counts, theirs = np.empty((4, comm.size), np.int32)
        self.weights = np.empty(n, np.float32)
        given = *integers(halo.counts, coupled), pointer(halo.strong, "uint8_t"), *integers(number)
        made = *integers(numbers), pointer(blocks), *integers(sent, shared, counts), pointer(self.weights, "float")
        library[d].pack_overlap(system, comm.size, *given, *made)
        comm.Alltoall(sent, came)
        numbers = exchanged(comm, numbers, halo.counts + sent, halo.their_counts + came)
        blocks = exchanged(comm, blocks, d * d * sent, d * d * came)
        self.rows: BlockCsr = room_of_rows(n + int(halo.their_counts.sum()), len(halo.far[1]) + int(came.sum()), d)
        received = *integers(halo.their_counts, came, numbers), pointer(blocks), *integers(theirs)
        if library[d].unpack_overlap(system, comm.size, *received, pointers(self.rows)):
            raise MemoryError("no memory left for the overlap of factors")
        self.exchange: Exchange = last.exchange if last is not None else Exchange(comm)
        self.exchange.connect(d, shared[: counts.sum()], counts, theirs)
        system.others, system.overlap = int(theirs.sum()), self.exchange.compiled
        system.between = pointers(self.rows)[0]
        system.weights = pointer(self.weights, "float")


def _split(rows: BlockCsr, d: int, first: int, parts: list[BlockCsr]) -> tuple[BlockCsr, BlockCsr]:
    """What couples the vertices from `first` on, whose rows these are, in their own numbers; and what couples them with
    others, with global columns. Both are in the memory of `parts`.
    """
    n = len(rows[0]) - 1
    library[d].split_rows(n, first, *map(pointers, (rows, *parts)))
    found = []
    for begin, at, values in parts:
        end = int(begin[n])
        values[end * d * d :][:SPARE] = 0.0
        found.append((begin, at[:end], values[: end * d * d].reshape(end, d, d)))
    return found[0], found[1]
