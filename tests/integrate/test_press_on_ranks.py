"""Motions that contact holds back, and supports that are released, give the same result on one rank and on two."""

import numpy as np
import pytest

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.scene import Barrier, Path, Plane, Rigid, Rotation, Sequential, Solver, Support
from problems import block, make_scene, make_stepper, polyline

STEPS = 9


def press(comm):
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
    return {
        "positions": [r.positions for r in reports],
        "behind": [r.behind for r in reports],
        "substeps": [r.remedies["substeps"] for r in reports],
    }


@pytest.mark.mpi
def test_one_rank_and_two_are_held_back_alike():
    one, two = results_on((1, 2), press)
    assert one["substeps"].max() > 1 and one["behind"].max() > 0.0
    # Parts end where detection says so: a step cut in many parts adds up differences of the linear solves.
    np.testing.assert_allclose(two["behind"], one["behind"], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-4 * 0.4)
