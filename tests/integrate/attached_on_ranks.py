"""Run by test_attached_bodies on one rank and two: python attached_on_ranks.py OUT.npz tears one block off another."""

import sys

import numpy as np
from mpi4py import MPI

from pdvol.integrate.marches import Start, direct
from pdvol.scene import Attachment, Barrier, Gravity, Plane, Solver, Support
from problems import SOFT, block, make_scene, make_stepper
from shapes import together

STEPS = 25
GAP = 0.004


def torn():
    """A block hangs from a held one by a strip of springs, turns on them and tears them one after the other."""
    mesh = together(
        block((0.0, 0.0), (0.4, 0.1), (6, 2), jitter=0.05), block((0.0, -0.2 - GAP), (0.4, -GAP), (5, 3), jitter=0.0)
    )
    attachment = Attachment("body 0", "body 1", lambda X: X[:, 1] < 0.01, stiffness=5e5, breaking=1400.0)
    scene = make_scene(
        (SOFT, SOFT),
        dt=0.01,
        steps=STEPS,
        loads=(Gravity((0.0, -9.81)),),
        supports=(Support(lambda X: X[:, 1] > 0.09, "body 0"),),
        obstacles=(Plane((0.0, -0.5), (0.0, 1.0)),),
        contact=(Barrier(dhat=2e-3),),
        solver=Solver(tolerance=1e-5, linear="direct"),
        attachments=(attachment,),
    )
    velocity = np.zeros_like(mesh.points)
    hangs = mesh.point_bodies == 1
    velocity[hangs, 1] = -1.5 * mesh.points[hangs, 0]
    return scene, mesh, velocity


def main(out):
    comm = MPI.COMM_WORLD
    scene, mesh, velocity = torn()
    problem = make_stepper(scene, mesh, (), comm)
    reports = list(direct(problem, Start.at_rest(mesh.points, velocity), scene.steps))
    if comm.rank == 0:
        np.savez(
            out,
            ranks=comm.size,
            positions=[r.positions for r in reports],
            broken=[len(r.terms.get("attachment", {}).get("broken", ())) for r in reports],
        )


if __name__ == "__main__":
    main(sys.argv[1])
