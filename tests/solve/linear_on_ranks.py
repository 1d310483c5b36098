"""Run by test_linear_on_ranks on one rank and more: python linear_on_ranks.py DIM OUT.npz multiplies and solves with
random springs, pairs across all ranks included.
"""

import sys

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from pdvol.levels.space import LevelSpace
from pdvol.scene import Solver
from pdvol.solve.linear.coarse_space import CoarseSpace, grid_weights
from pdvol.solve.linear.solver import LINEAR_METHODS, LinearSolver
from pdvol.solve.linear.system_matrix import SystemMatrix
from shapes import box
from springs import springs


def main(d, out):
    comm = MPI.COMM_WORLD
    space = LevelSpace(box(d, 5, jitter=0.1, seed=1), comm)
    field = np.random.default_rng(3).standard_normal(space.mesh.points.shape)
    system = SystemMatrix(space, space.owned_points % 7 == 0)
    right, solution, results = space.create_vector(), space.create_vector(), {}
    right.setArray(space.from_input(field).ravel())
    whole = lambda vector: space.to_input(vector.getArray().reshape(-1, d))
    for pairs in (True, False):  # couplings between ranks change
        system.assemble(springs(space, mass=0.1, pairs=pairs))
        system.shell.mult(right, solution)
        results[f"product {pairs}"] = whole(solution)
        for method in LINEAR_METHODS:
            made = LinearSolver(
                PETSc.KSP().create(comm),
                Solver(linear=method, linear_rtol=1e-11),
                lambda: CoarseSpace(space, grid_weights(space.mesh), system.all_supported),
            )
            made.set_matrix(system)
            made.solve(right, solution)
            assert made.method == method
            results[f"{method} {pairs}"] = whole(solution)
    if comm.rank == 0:
        np.savez(out, ranks=comm.size, **results)


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
