"""Bodies on springs: periods and breaking worked out by hand, interrupted marches, ranks, and levels that agree."""

import numpy as np
import pytest

from on_ranks import results_on
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Attachment, Barrier, Gravity, NeoHookean, Plane, Solver, Support
from problems import SOFT, block, make_scene, make_stepper
from shapes import together

STIFF = NeoHookean(1e9, 0.3, 1000.0)
GAP, LENGTH, K, DT = 0.1, 0.05, 2000.0, 0.01
MASS = 1000.0 * 0.2 * 0.1  # kg of each block, per metre of depth
OMEGA2 = K / (MASS / 2)  # 1/s^2: two masses on a spring have the reduced mass m/2


def blocks(steps, speed=0.0, **settings):
    """Two blocks without gravity, `GAP` apart, on springs of rest length `LENGTH`; the right one has a speed."""
    mesh = together(block((0.0, 0.0), (0.2, 0.1), 2), block((0.2 + GAP, 0.0), (0.4 + GAP, 0.1), 2))
    spring = Attachment(
        "body 0", "body 1", lambda X: X[:, 0] > 0.199, stiffness=K, **({"rest_length": LENGTH} | settings)
    )
    scene = make_scene(
        (STIFF, STIFF), dt=DT, steps=steps, attachments=(spring,), solver=Solver(tolerance=1e-7, linear="direct")
    )
    velocity = speed * np.outer(mesh.point_bodies == 1, (1.0, 0.0))
    return scene, mesh, velocity


def march(scene, mesh, velocity, integrator=None):
    stepper = make_stepper(scene, mesh, integrator=integrator)
    return list(direct(stepper, Start.at_rest(mesh.points, velocity), scene.steps))


def stretch(report, mesh):
    """How much longer than at rest the springs are: the mean distance of both blocks, less that."""
    apart = [report.positions[mesh.point_bodies == i, 0].mean() for i in range(2)]
    return apart[1] - apart[0] - 0.2 - LENGTH


def by_hand(integrator, steps, first, speed=0.0, most=np.inf):
    """e'' = -omega^2 e by the integrator's formula; the first step is implicit Euler's. The spring breaks at the end of
    a step with e > `most`.

    Returns e after each step, and how many steps the spring bore.
    """
    e, v, omega2, bore = [first], [speed], OMEGA2, steps
    for number in range(1, steps + 1):
        second = integrator == "bdf2" and number > 1
        h = 2.0 * DT / 3.0 if second else DT
        reached = (4.0 * e[-1] - e[-2] + h * (4.0 * v[-1] - v[-2])) / 3.0 if second else e[-1] + DT * v[-1]
        e.append(reached / (1.0 + omega2 * h**2))
        v.append((3.0 * e[-1] - 4.0 * e[-2] + e[-3]) / (2.0 * DT) if second else (e[-1] - e[-2]) / DT)
        if omega2 and e[-1] > most:
            omega2, bore = 0.0, number
    return np.array(e[1:]), bore


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_two_blocks_swing_as_the_integrator_s_formula_says(integrator):
    """The springs are pulled less than their rest length, so that they never get to no length, where their direction
    would turn.
    """
    steps, first = 60, 0.02  # and m
    scene, mesh, velocity = blocks(steps, rest_length=GAP - first)
    found = np.array([stretch(report, mesh) for report in march(scene, mesh, velocity, INTEGRATORS[integrator]())])
    found -= GAP - LENGTH - first
    np.testing.assert_allclose(found, by_hand(integrator, steps, first)[0], atol=2e-5)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_spring_breaks_at_its_force_and_stays_broken(integrator):
    """It pulls with K e: with 1 m/s the first step past the force is known, and nothing acts from then on."""
    steps, force = 30, 100.0
    scene, mesh, velocity = blocks(steps, 1.0, rest_length=None, breaking=force)
    expected, bore = by_hand(integrator, steps, 0.0, 1.0, force / K)
    assert 2 < bore < 20
    reports = march(scene, mesh, velocity, INTEGRATORS[integrator]())
    found = np.array([stretch(report, mesh) for report in reports]) - (GAP - LENGTH)
    np.testing.assert_allclose(found, expected, atol=2e-5)
    for number, report in enumerate(reports, 1):  # a spring for each of the two facets
        assert report.terms == ({} if number < bore else {"attachment": {"broken": [0, 1]}})
    assert all(report.energy["attachment"] > 0.0 for report in reports[:bore])
    assert reports[-1].energy["attachment"] == 0.0


def torn():
    """A block hangs from a held one by a strip of springs, turns on them and tears them one after the other."""
    gap = 0.004
    mesh = together(
        block((0.0, 0.0), (0.4, 0.1), (6, 2), jitter=0.05), block((0.0, -0.2 - gap), (0.4, -gap), (5, 3), jitter=0.0)
    )
    attachment = Attachment("body 0", "body 1", lambda X: X[:, 1] < 0.01, stiffness=5e5, breaking=1400.0)
    scene = make_scene(
        (SOFT, SOFT),
        dt=0.01,
        steps=25,
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


def tear(comm):
    scene, mesh, velocity = torn()
    problem = make_stepper(scene, mesh, (), comm)
    reports = list(direct(problem, Start.at_rest(mesh.points, velocity), scene.steps))
    return {
        "positions": [r.positions for r in reports],
        "broken": [len(r.terms.get("attachment", {}).get("broken", ())) for r in reports],
    }


@pytest.mark.mpi
def test_two_ranks_break_the_same_springs():
    one, two = results_on((1, 2), tear)
    assert one["broken"].max() == 6
    np.testing.assert_array_equal(two["broken"], one["broken"])
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-5)
