"""Muscles, pressure and a modulus that follows keys give the same motion on one rank and on two."""

import numpy as np
import pytest

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.scene import Barrier, Gravity, Keyed, Muscle, NeoHookean, Plane, Pressure, Solver
from problems import SOFT, block, make_scene, make_stepper
from shapes import level, together

STEPS = 12


def ring(centre, inner, outer, around=24):
    """A ring of two layers of triangles."""
    angles = 2.0 * np.pi * np.arange(around) / around
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.concatenate([r * circle + centre for r in (inner, 0.5 * (inner + outer), outer)])
    i = np.arange(2 * around)
    j = (i + 1) % around + around * (i // around)
    cells = np.concatenate([np.column_stack([i, j, j + around]), np.column_stack([i, j + around, i + around])])
    return level(points, cells)


def actuate(comm):
    mesh = together(ring((0.2, 0.203), 0.12, 0.2), block((0.45, 0.01), (0.95, 0.11), (8, 2), jitter=0.1))
    scene = make_scene(
        (SOFT, NeoHookean(Keyed((0.0, 0.1), (1e5, 5e4)), 0.4, 1000.0, damping=0.01)),
        dt=0.01,
        steps=STEPS,
        loads=(Gravity((0.0, -9.81)), Pressure("body 0", lambda t: 2e5 * t)),
        muscles=(Muscle("body 1", (1.0, 0.0), 4e4, lambda t, X: np.maximum(0.0, np.sin(20.0 * (X[:, 0] - t)))),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),),
        contact=(Barrier(dhat=2e-3),),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    problem = make_stepper(scene, mesh, (), comm)
    reports = list(direct(problem, Start.at_rest(mesh.points, 0.0 * mesh.points), scene.steps))
    kinds = ("muscle", "pressure", "elastic", "damping")
    return {
        "positions": [r.positions for r in reports],
        "energies": [[r.energy[kind] for kind in kinds] for r in reports],
    }


@pytest.mark.mpi
def test_one_rank_and_two_move_alike():
    one, two = results_on((1, 2), actuate)
    assert np.abs(one["energies"][-1]).min() > 0.0
    assert np.abs(one["positions"][-1] - one["positions"][0]).max() > 5e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-6)
