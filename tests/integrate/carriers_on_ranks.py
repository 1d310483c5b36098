"""Run by test_carriers on one rank and two: python carriers_on_ranks.py OUT.npz has a ball push two cubes."""

import sys

import numpy as np
from mpi4py import MPI
from test_carriers import ball_and_cubes

from pdvol.integrate.marches import Start, direct
from problems import make_stepper


def main(out):
    comm = MPI.COMM_WORLD
    scene, mesh, geometry = ball_and_cubes(2, 5.0, bodies=2)
    start = Start.at_rest(mesh.points, 0.0 * mesh.points)
    reports = list(direct(make_stepper(scene, mesh, geometry, comm), start, 6))
    if comm.rank == 0:
        positions, behind = [r.positions for r in reports], [r.behind for r in reports]
        np.savez(out, ranks=comm.size, positions=positions, behind=behind)


if __name__ == "__main__":
    main(sys.argv[1])
