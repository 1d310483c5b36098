"""Vertices of other ranks in a rank's incomplete factor: additive Schwarz with an overlap of one layer.

A factor of a rank's own rows loses what couples them with others'. Stiff contacts across the border then take twice the
iterations, since each side resists what both do together. So a rank's factor A_k also has the vertices of others that
are strongly coupled with its own. The preconditioner is the sum over the ranks k of W A_k^-1 W, in which the squares of
the weights W of a vertex sum to one over the factors that have it. It is symmetric, unlike restricted additive Schwarz
(Cai and Sarkis 1999), which weighs on one side.
"""

from typing import Any

import numpy as np

from pdvol.compiled import integers, pointer
from pdvol.levels.space import LevelSpace
from pdvol.native import library
from pdvol.potentials.assembly.hessian_blocks import BlockCsr, pointers, room_of_rows
from pdvol.solve.linear.halo import Halo
from pdvol.solve.linear.messages import Exchange, exchanged


class Overlap:
    """The rows that other ranks' vertices add to a factor, and what ranks exchange to solve with it. Both are written
    into a `linear_system *`.

    Blocks between vertices of two other ranks are left out: neither of these knows that both are here. Construction is
    collective.

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
