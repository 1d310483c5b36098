"""What couples a rank's vertices with those of other ranks, and what ranks exchange for products with their rows."""

from typing import Any

import numpy as np

from pdvol.compiled import integers, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import SPARE, BlockCsr, pointers, room_of_rows
from pdvol.solve.linear.messages import Exchange

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
