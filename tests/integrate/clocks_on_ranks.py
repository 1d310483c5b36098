"""Run by test_clocks on one rank and two: python clocks_on_ranks.py OUT.npz presses one block and drives another."""

import sys

import numpy as np
from mpi4py import MPI
from test_clocks import DOWN, pressed_and_driven, ram

from pdvol.integrate.marches import Start, direct
from problems import make_stepper


def main(out):
    comm = MPI.COMM_WORLD
    scene, mesh = pressed_and_driven(2, DOWN)
    problem = make_stepper(scene, mesh, [ram(2)], comm)
    reports = list(direct(problem, Start.at_rest(mesh.points, 0.0 * mesh.points), 4))
    if comm.rank == 0:
        np.savez(
            out,
            ranks=comm.size,
            positions=[r.positions for r in reports],
            behind=[r.behind for r in reports],
            late=[r.late.get("obstacle 0", 0.0) for r in reports],
        )


if __name__ == "__main__":
    main(sys.argv[1])
