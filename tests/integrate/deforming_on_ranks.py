"""Run by test_deforming on one rank and two: python deforming_on_ranks.py OUT.npz throws a block up by a sheet."""

import sys

import numpy as np
from mpi4py import MPI
from test_deforming import geometry, thrown_up

from pdvol.integrate.marches import Start, direct
from problems import make_stepper


def main(out):
    comm = MPI.COMM_WORLD
    scene, mesh = thrown_up(2)
    problem = make_stepper(scene, mesh, geometry(scene), comm)
    reports = list(direct(problem, Start.at_rest(mesh.points, 0.0 * mesh.points), 4))
    if comm.rank == 0:
        positions, behind = [r.positions for r in reports], [r.behind for r in reports]
        np.savez(out, ranks=comm.size, positions=positions, behind=behind)


if __name__ == "__main__":
    main(sys.argv[1])
