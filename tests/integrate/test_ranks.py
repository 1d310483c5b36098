"""The number of ranks does not change the motion."""

import numpy as np
import pytest
from test_carriers import ball_and_cubes
from test_clocks import DOWN, pressed_and_driven, ram

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, Plane, Rigid, Solver, Support, Translation
from problems import SOFT, block, make_scene, make_stepper, spike, weight
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
    tip = np.r_[[0.11, 0.1][: d - 1], mesh.points[:, -1].min() - 0.004]
    end = Support(lambda X: X[:, 0] > 0.41, "body 1", Translation(tuple(-0.1 * np.eye(d)[0])))
    scene = make_scene(
        (SOFT, SOFT),
        dt=0.01,
        loads=(weight(d),),
        supports=(end,),
        obstacles=(Plane((0.0,) * d, tuple(np.eye(d)[-1])), Rigid("spike", name="spike")),
        elements=elements,
        contact=(Barrier(dhat=0.008), Friction(0.3, eps_v=0.01, pairs=PAIRS)),
        solver=Solver(tolerance=1e-5, linear="direct"),
    )
    velocity = np.zeros_like(mesh.points)
    velocity[mesh.point_bodies == 0, 0] = 0.8
    return scene, mesh, (spike(tip),), velocity


def blocks_fall(d, elements):
    scene, mesh, geometry, velocity = scene_of(d, elements)
    return scene, mesh, geometry, velocity, STEPS


def cubes_are_carried():
    scene, mesh, geometry = ball_and_cubes(2, 5.0, bodies=2)
    return scene, mesh, geometry, 0.0 * mesh.points, 6


def a_ram_is_held_back():
    scene, mesh = pressed_and_driven(2, DOWN)
    return scene, mesh, [ram(2)], 0.0 * mesh.points, 4


def marched(comm, make, integrator, *given):
    """What reports say of a march of a scene by a function of this name."""
    scene, mesh, geometry, velocity, steps = globals()[make](*given)
    problem = make_stepper(scene, mesh, geometry, comm, INTEGRATORS[integrator]())
    reports = list(direct(problem, Start.at_rest(mesh.points, velocity), steps))
    of = lambda name: [getattr(report, name) for report in reports]
    return {
        **{name: of(name) for name in ("positions", "contacts", "cuts", "behind", "kappa")},
        "owned": comm.gather(problem.space.n_owned),
        "energies": [[r.energy[k] for k in sorted(r.energy)] for r in reports],
        "residuals": [r.friction_residual or 0.0 for r in reports],
        "late": [r.late.get("obstacle 0", 0.0) for r in reports],
        "kinds": sorted(reports[0].energy),
    }


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("ranks", "integrator", "d", "elements"),
    [
        (2, "implicit_euler", 3, "linear"),
        (2, "bdf2", 2, "linear"),
        (3, "implicit_euler", 2, "smoothed"),
        pytest.param(4, "implicit_euler", 3, "smoothed", marks=pytest.mark.slow),
    ],
)
def test_one_rank_and_more_agree(ranks, integrator, d, elements):
    one, more = results_on((1, ranks), marched, "blocks_fall", integrator, d, elements)
    assert more["owned"].min() > 0
    np.testing.assert_array_equal(one["cuts"], 0)  # a cut step on one side only would be another motion
    assert one["contacts"].max() > 2
    kinds = list(one["kinds"])
    assert all(one["energies"][:, kinds.index(kind)].max() > 0.0 for kind in ("barrier", "friction"))
    np.testing.assert_allclose(more["positions"], one["positions"], rtol=0.0, atol=SAME * SIZE)
    np.testing.assert_allclose(more["energies"], one["energies"], rtol=1e-3, atol=1e-6 * np.abs(one["energies"]).max())
    np.testing.assert_allclose(more["residuals"], one["residuals"], rtol=1e-2, atol=1e-4)
    np.testing.assert_allclose(more["kappa"], one["kappa"], rtol=1e-4)
    assert one["residuals"].max() > 0.0


@pytest.mark.mpi
@pytest.mark.parametrize(("make", "waits"), [("cubes_are_carried", False), ("a_ram_is_held_back", True)])
def test_two_ranks_stop_the_same_motions(make, waits):
    one, two = results_on((1, 2), marched, make, "implicit_euler")
    assert (one["behind"].max() > 0.01) == waits and (one["late"] == one["behind"]).all()
    np.testing.assert_allclose(two["behind"], one["behind"], rtol=0.0, atol=1e-5 * waits)
    np.testing.assert_allclose(two["late"], one["late"], rtol=0.0, atol=1e-5 * waits)
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-4)
