"""Run by test_rest on one rank and two: python rest_on_ranks.py OUT.npz lets a heap come to rest."""

import sys

import numpy as np
from mpi4py import MPI
from test_rest import heap

from pdvol.integrate.marches import Start, direct
from problems import make_stepper


def main(out):
    comm = MPI.COMM_WORLD
    scene, mesh = heap(250)
    start = Start.at_rest(mesh.points, 0.0 * mesh.points)
    reports = list(direct(make_stepper(scene, mesh, comm=comm), start, scene.steps))
    if comm.rank == 0:
        positions, joined = [r.positions for r in reports], [r.joined for r in reports]
        np.savez(out, ranks=comm.size, positions=positions, joined=joined)


if __name__ == "__main__":
    main(sys.argv[1])
