"""The number of ranks does not change the motion."""

import numpy as np
import pytest
from test_carriers import ball_and_cubes
from test_clocks import DOWN, pressed_and_driven, ram

import pdvol
from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.stepper import Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, Plane, Rigid, Solver, Support, Translation
from problems import SOFT, block, make_scene, make_stepper, spike, weight
from shapes import box, together

SAME = 1e-6  # of the scene's size, over the first steps with the direct solver
STEPS, SIZE = 8, 0.5
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


# ---- what cells are made of, where bodies start, and what all terms do

BREAKING = 800.0  # N: some of the springs break
KINDS = {"attachment", "damping", "drag", "elastic", "load", "muscle", "pressure", "pull"}


def bent(X):
    """A parabola upward from x = 2 on either side, half as wide."""
    return np.column_stack([2.0 + 0.8 * (X[:, 0] - 2.0), X[:, 1] + 0.3 * (X[:, 0] - 2.0) ** 2, *X[:, 2:].T])


def all_terms(d, elements):
    """A unit box held at its left: three laws, one of them stiff, one graded and one that changes with time, damped and
    dragged, with a muscle, pushed and hit. Springs lead to a second box, which starts bent: its modulus follows keys, a
    muscle and pressure act in it, and a support lets it go.
    """
    soft = pdvol.FixedCorotational(
        lambda X: 1e5 * (1 + X[:, 1]), density=lambda X: 1000.0 + 500.0 * X[:, 0], damping=0.02
    )
    regions = (
        pdvol.Region(pdvol.StVenantKirchhoff(pdvol.Keyed((0.0, 0.05), (3e5, 6e5))), lambda X: X[:, 0] < 0.4),
        pdvol.Region(pdvol.NeoHookean(1e9), lambda X: X[:, -1] > 0.7),
    )
    other = pdvol.NeoHookean(pdvol.Keyed((0.0, 0.1), (1e5, 5e4)), 0.4, 1000.0, damping=0.01)
    along, down = tuple(np.eye(d)[0]), (0.0,) * (d - 1) + (-9.81,)
    loads = (
        pdvol.Gravity(lambda t: (1.0 + t) * np.array(down)),
        pdvol.Flow(along, 1000.0, body="one"),
        pdvol.Impulse(along, 0.015, lambda X: X[:, 0] > 0.7, body="one"),
        pdvol.Force(lambda t: 1e3 * t * np.ones(d), lambda X: X[:, 1] > 0.5),
        pdvol.PointForce(tuple(300.0 * np.eye(d)[-1]), (0.9,) * d, body="one"),
        pdvol.Pressure("other", lambda t: 2e5 * t),
    )
    springs = {"stiffness": 1e3, "rest_length": 0.45, "breaking": BREAKING}
    waves = lambda t, X: np.maximum(0.0, np.sin(20.0 * (X[:, 0] - t)))
    return pdvol.Scene(
        (
            pdvol.Body(("coarse", "fine"), soft, regions=regions, name="one"),
            pdvol.Body(("coarse", "fine"), other, start=bent, name="other"),
        ),
        dt=0.01,
        steps=5,
        loads=loads,
        supports=(
            pdvol.Support(lambda X: X[:, 0] < 1e-9, body="one"),
            pdvol.Support(lambda X: X[:, 0] > 2.5 - 1e-9, body="other", release=0.025),
        ),
        attachments=(pdvol.Attachment("one", "other", lambda X: X[:, 0] > 0.99, **springs),),
        muscles=(
            pdvol.Muscle("one", along, 2e4, where=lambda X: X[:, 1] < 0.6),
            pdvol.Muscle("other", along, 4e4, waves),
        ),
        pulls=(pdvol.Pull("one", (1.0,) * d, (0.0, 0.1), [(1.0,) * d, (1.5,) * d], 1e4),),
        elements=elements,
        solver=pdvol.Solver(tolerance=1e-6, linear="direct"),
    )


def load(comm, d, elements):
    scene = all_terms(d, elements)
    hierarchy = Hierarchy([together(box(d, n), box(d, n, 1.5, 2.5)) for n in (2, 4)], comm)
    model = level_model(scene, hierarchy, 1, 1.0)
    materials = model.materials
    reports = list(direct(Stepper(model, hierarchy[1]), Start.at_rest(model.start, model.velocity), scene.steps))
    return {
        "young": materials.young,
        "density": materials.density,
        "law": materials.law,
        "start": model.start,
        "positions": [r.positions for r in reports],
        "energies": [[r.energy[k] for k in sorted(r.energy)] for r in reports],
        "kinds": sorted(reports[0].energy),
        "broken": [len(r.terms.get("attachment", {}).get("broken", ())) for r in reports],
    }


@pytest.mark.mpi
@pytest.mark.parametrize(("d", "elements"), [(2, "linear"), (3, "smoothed")])
def test_materials_starts_and_terms_are_alike_on_two_ranks(d, elements):
    one, two = results_on((1, 2), load, d, elements)
    assert 0 < one["broken"].max() < 8
    for name in ("young", "density", "law", "broken"):
        np.testing.assert_array_equal(one[name], two[name])
    assert set(one["law"]) == {0, 1, 2} and one["young"].max() == 1e9
    assert {kind for kind, energy in zip(one["kinds"], one["energies"].T, strict=True) if energy.any()} >= KINDS
    assert np.abs(one["positions"][-1] - one["start"]).max() > 1e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-9 * np.abs(one["energies"]).max())
