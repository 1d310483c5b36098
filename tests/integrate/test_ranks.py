"""The number of ranks does not change the motion."""

import numpy as np
import pytest

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, Gravity, Plane, Rigid, Solver, Support, Translation
from problems import SOFT, block, make_scene, make_stepper, polyline, tetrahedron
from shapes import together

SAME = 1e-6  # of the scene's size, over the first steps with the direct solver


STEPS, SIZE = 12, 0.5
PAIRS = {("body 0", "body 1"): 0.6, ("spike", "body 0"): 0.1, ("body 1", "plane"): 0.2}


def scene_of(d, elements):
    """Two blocks side by side, the left one thrown at the right one, over a plane and a spike; a pushed support holds
    the right one's end.
    """
    gap, low = 0.006, 0.012
    left = block((0.0,) * (d - 1) + (low,), (0.2,) * (d - 1) + (low + 0.2,), 3, jitter=0.1, seed=1)
    right = block(
        (0.22 + gap,) + (0.05,) * (d - 2) + (low,),
        (0.42 + gap,) + (0.2,) * (d - 2) + (low + 0.15,),
        2,
        jitter=0.1,
        seed=2,
    )
    mesh = together(left, right)
    bottom = mesh.points[:, -1].min()
    if d == 2:
        spike = polyline([[0.02, bottom - 0.2], [0.18, bottom - 0.2], [0.11, bottom - 0.004]])
    else:
        spike = tetrahedron(
            [[0.0, 0.0, bottom - 0.2], [0.3, 0.0, bottom - 0.2], [0.0, 0.3, bottom - 0.2], [0.09, 0.1, bottom - 0.004]]
        )
    end = Support(lambda X: X[:, 0] > 0.41, "body 1", Translation(tuple(-0.1 * np.eye(d)[0])))
    scene = make_scene(
        (SOFT, SOFT),
        dt=0.01,
        steps=STEPS,
        loads=(Gravity((0.0,) * (d - 1) + (-9.81,)),),
        supports=(end,),
        obstacles=(Plane((0.0,) * d, tuple(np.eye(d)[-1])), Rigid("spike", name="spike")),
        elements=elements,
        contact=(Barrier(dhat=0.008), Friction(0.3, eps_v=0.01, pairs=PAIRS)),
        solver=Solver(tolerance=1e-5, linear="direct"),
    )
    velocity = np.zeros_like(mesh.points)
    velocity[mesh.point_bodies == 0, 0] = 0.8
    return scene, mesh, (spike,), velocity


def fall(comm, d, integrator, elements):
    scene, mesh, obstacles, velocity = scene_of(d, elements)
    problem = make_stepper(scene, mesh, obstacles, comm, INTEGRATORS[integrator]())
    reports = list(direct(problem, Start.at_rest(mesh.points, velocity), scene.steps))
    owned = comm.gather(problem.space.n_owned)
    return {
        "owned": owned,
        "positions": [r.positions for r in reports],
        "contacts": [r.contacts for r in reports],
        "energies": [[r.energy[k] for k in sorted(r.energy)] for r in reports],
        "cuts": [r.cuts for r in reports],
        "residuals": [r.friction_residual for r in reports],
        "kappas": [r.kappa for r in reports],
        "kinds": sorted(reports[0].energy),
    }


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("d", "ranks", "integrator", "elements"),
    [
        (3, 2, "implicit_euler", "linear"),
        (2, 2, "bdf2", "linear"),
        (2, 3, "implicit_euler", "smoothed"),
        pytest.param(3, 4, "implicit_euler", "smoothed", marks=pytest.mark.slow),
    ],
)
def test_one_rank_and_more_agree(d, ranks, integrator, elements):
    one, more = results_on((1, ranks), fall, d, integrator, elements)
    assert more["owned"].min() > 0
    assert one["positions"].shape[0] == STEPS
    np.testing.assert_array_equal(one["cuts"], 0)  # a cut step on one side only would be another motion
    assert one["contacts"].max() > 2
    kinds = list(one["kinds"])
    assert all(one["energies"][:, kinds.index(kind)].max() > 0.0 for kind in ("barrier", "friction"))
    np.testing.assert_allclose(more["positions"], one["positions"], rtol=0.0, atol=SAME * SIZE)
    np.testing.assert_allclose(more["energies"], one["energies"], rtol=1e-3, atol=1e-6 * np.abs(one["energies"]).max())
    np.testing.assert_allclose(more["residuals"], one["residuals"], rtol=1e-2, atol=1e-4)
    np.testing.assert_allclose(more["kappas"], one["kappas"], rtol=1e-4)
    assert one["residuals"].max() > 0.0
