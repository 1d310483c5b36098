"""Run by test_binding on one rank and two: python binding_on_ranks.py DIM OUT.npz writes a binding and every
interpolant's PETSc matrix.

All in input order.
"""

import sys

import numpy as np
from mpi4py import MPI
from test_binding import comb_pair

from pdvol.levels.binding import bind
from pdvol.levels.prolongation import Prolongation
from pdvol.levels.space import LevelSpace
from pdvol.registry import INTERPOLANTS
from shapes import together


def input_triplets(prolongation):
    """The matrix's nonzeros as sorted (row, column, value), indices in input order, on rank 0."""
    fine, coarse, d = prolongation.fine, prolongation.coarse, prolongation.fine.dim
    indptr, columns, values = prolongation.matrix.getValuesCSR()
    rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr)) + prolongation.matrix.getOwnershipRange()[0]
    local = [(np.argsort(s.point_blocks)[i // d] * d + i % d) for s, i in ((fine, rows), (coarse, columns))]
    pieces = fine.comm.gather(np.column_stack([*local, values]))
    triplets = None if pieces is None else np.concatenate(pieces)
    return triplets if triplets is None else triplets[np.lexsort((triplets[:, 1], triplets[:, 0]))]


def main(d, out):
    comm = MPI.COMM_WORLD
    fine, coarse, _, _ = comb_pair(d)
    move = lambda mesh: type(mesh)(mesh.points + np.eye(d)[0] * 1.5, mesh.cells, mesh.bodies, mesh.regions)
    fine, coarse = LevelSpace(together(fine, move(fine)), comm), LevelSpace(together(coarse, move(coarse)), comm)
    binding, back = bind(fine, coarse), bind(coarse, fine)
    triplets = {name: input_triplets(Prolongation(coarse, fine, binding, INTERPOLANTS[name])) for name in INTERPOLANTS}
    if comm.rank == 0:
        np.savez(
            out,
            ranks=comm.size,
            cells=binding.cells,
            kind=binding.kind,
            weights=binding.weights,
            **triplets,
            back_cells=back.cells,
            back_kind=back.kind,
            back_weights=back.weights,
        )


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
