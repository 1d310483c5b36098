"""Bodies that start bent move alike on one rank and on two."""

from dataclasses import replace

import numpy as np
import pytest

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.scene import Attachment, Barrier, Gravity, Plane, Solver, Support
from problems import SOFT, block, make_scene, make_stepper
from shapes import together

STEPS = 10


def bent(X):
    """A parabola upward from x = 0.5 on either side, half as wide."""
    return np.column_stack([0.5 + 0.8 * (X[:, 0] - 0.5), X[:, 1] + 0.6 * (X[:, 0] - 0.5) ** 2])


def let_go(comm):
    bars = [
        block((0.0, low), (1.0, low + 0.08), (16, 2), jitter=0.1, seed=seed) for seed, low in ((1, 0.02), (2, 0.14))
    ]
    mesh = together(*bars)
    scene = make_scene(
        (SOFT, SOFT),
        dt=0.01,
        steps=STEPS,
        loads=(Gravity((0.0, -9.81)),),
        attachments=(Attachment("body 0", "body 1", lambda X: X[:, 1] > 0.09, stiffness=1e3),),
        supports=(Support(lambda X: X[:, 0] < 1e-9, body="body 1", release=0.05),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),),
        contact=(Barrier(dhat=2e-3),),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    scene = replace(scene, bodies=tuple(replace(body, start=bent) for body in scene.bodies))
    problem = make_stepper(scene, mesh, (), comm)
    reports = list(direct(problem, Start.at_rest(problem.model.start, problem.model.velocity), scene.steps))
    return {
        "positions": [r.positions for r in reports],
        "energies": [[r.energy[kind] for kind in ("attachment", "elastic", "load")] for r in reports],
    }


@pytest.mark.mpi
def test_one_rank_and_two_move_alike():
    one, two = results_on((1, 2), let_go)
    assert np.abs(one["energies"][-1]).min() > 0.0
    assert np.abs(one["positions"][-1] - one["positions"][0]).max() > 5e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-6)
