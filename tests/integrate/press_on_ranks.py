"""Run by test_press_on_ranks on one rank and two: python press_on_ranks.py OUT.npz presses two supports and a turning
bar against contact.
"""

import sys

import numpy as np
from mpi4py import MPI

from pdvol.integrate.marches import Start, direct
from pdvol.scene import Barrier, Path, Plane, Rigid, Rotation, Sequential, Solver, Support
from problems import block, make_scene, make_stepper, polyline

STEPS = 9


def main(out):
    comm = MPI.COMM_WORLD
    mesh = block((0.0, 0.0), (0.4, 0.2), (6, 3), jitter=0.1)
    bar = polyline([(-0.05, 0.25), (0.45, 0.25), (0.45, 0.3), (-0.05, 0.3)])
    swing = Sequential((Rotation(-6.0, (-0.05, 0.25)), Path((0.0, 0.1), ((0.0, 0.0), (0.0, -0.02)), smooth=True)))
    scene = make_scene(
        dt=0.02,
        steps=STEPS,
        obstacles=(Rigid("bar", motion=swing), Plane((0.0, -0.05), (0.0, 1.0))),
        contact=(Barrier(dhat=5e-3),),
        supports=(Support(lambda X: X[:, 1] < 1e-9, release=0.15), Support(lambda X: X[:, 0] < 1e-9, release=0.05)),
        solver=Solver(tolerance=1e-5, linear="direct"),
    )
    problem = make_stepper(scene, mesh, (bar,), comm)
    reports = list(direct(problem, Start.at_rest(mesh.points, 0.0 * mesh.points), scene.steps))
    if comm.rank == 0:
        np.savez(
            out,
            ranks=comm.size,
            positions=[r.positions for r in reports],
            behind=[r.behind for r in reports],
            substeps=[r.remedies["substeps"] for r in reports],
        )


if __name__ == "__main__":
    main(sys.argv[1])
