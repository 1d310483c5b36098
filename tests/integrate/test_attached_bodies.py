"""Bodies on springs: periods and breaking worked out by hand. Pulls: momentum and bounds of their forces, the time in
which they bring a body, what they do before and after, the same material on all levels, and keys to the last bit.
"""

import json
from dataclasses import replace

import numpy as np
import pytest

from pdvol.integrate.marches import Start, direct
from pdvol.levels.attachments import LEAST_WEIGHTS, MOST_WEIGHTS, REACH, Pulls
from pdvol.registry import INTEGRATORS
from pdvol.scene import Attachment, Hand, Led, NeoHookean, Pull, Solver, Still
from problems import block, make_scene, make_stepper, masses, weight
from shapes import together

GAP, K, DT, STEPS = 0.1, 2000.0, 0.01, 40
OMEGA2 = K / (1000.0 * 0.2 * 0.1 / 2)  # 1/s^2: two masses on a spring have the reduced mass, half of 20 kg per metre


def by_hand(integrator, first, speed, most):
    """e'' = -omega^2 e by the integrator's formula; the first step is implicit Euler's. The spring breaks at the end of
    a step with e > `most`.

    Returns e after each step, and how many steps the spring bore.
    """
    e, v, omega2, bore = [first], [speed], OMEGA2, STEPS
    for number in range(1, STEPS + 1):
        second = integrator == "bdf2" and number > 1
        h = 2.0 * DT / 3.0 if second else DT
        reached = (4.0 * e[-1] - e[-2] + h * (4.0 * v[-1] - v[-2])) / 3.0 if second else e[-1] + DT * v[-1]
        e.append(reached / (1.0 + omega2 * h**2))
        v.append((3.0 * e[-1] - 4.0 * e[-2] + e[-3]) / (2.0 * DT) if second else (e[-1] - e[-2]) / DT)
        if omega2 and e[-1] > most:
            omega2, bore = 0.0, number
    return np.array(e[1:]), bore


@pytest.mark.parametrize(("first", "speed", "force"), [(0.02, 0.0, np.inf), (0.0, 1.0, 100.0)])
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_two_blocks_swing_as_the_integrator_s_formula_says_until_springs_break(integrator, first, speed, force):
    """Springs that are pulled by less than their length never get to no length, where their direction would turn. With
    1 m/s the first step past the force K e is known, and nothing acts from then on.
    """
    mesh = together(block((0.0, 0.0), (0.2, 0.1), 2), block((0.2 + GAP, 0.0), (0.4 + GAP, 0.1), 2))
    more = {"stiffness": K, "rest_length": GAP - first, "breaking": None if force == np.inf else force}
    springs, stiff = Attachment("body 0", "body 1", lambda X: X[:, 0] > 0.199, **more), NeoHookean(1e9, 0.3, 1000.0)
    scene = make_scene((stiff, stiff), dt=DT, attachments=(springs,), solver=Solver(1e-7, linear="direct"))
    stepper = make_stepper(scene, mesh, integrator=INTEGRATORS[integrator]())
    start = Start.at_rest(mesh.points, speed * np.outer(mesh.point_bodies == 1, (1.0, 0.0)))
    reports = list(direct(stepper, start, STEPS))
    apart = [np.subtract(*(r.positions[mesh.point_bodies == i, 0].mean() for i in (1, 0))) for r in reports]
    expected, bore = by_hand(integrator, first, speed, force / K)
    np.testing.assert_allclose(np.array(apart) - 0.2 - (GAP - first), expected, atol=2e-5)
    assert 2 < bore < 20 or force == np.inf
    for number, report in enumerate(reports, 1):  # a spring for each of the two facets
        assert report.terms == ({} if number < bore or force == np.inf else {"attachment": {"broken": [0, 1]}})
        assert (report.energy["attachment"] > 0.0) == (number <= bore)


# ---- pulls

STIFF = NeoHookean(1e6, 0.3, 1000.0)
SIDE = 0.2
MASS, WEIGHT = 1000.0 * SIDE**2, 1000.0 * SIDE**2 * 9.81  # kg and N per metre of depth


def pulled(points=((0.1, 0.2), (0.2, 0.3), (0.2, 0.3)), times=(0.0, 0.05, 1.0), gravity=9.81, steps=40, **settings):
    """A block whose upper side is pulled."""
    pull = Pull("body 0", (0.1, 0.2), times, points, **settings)
    loads = (weight(2, gravity),) if gravity else ()
    solver = Solver(tolerance=1e-8, linear="direct")
    return make_scene((STIFF,), dt=DT, steps=steps, loads=loads, pulls=(pull,), solver=solver)


def march(scene, mesh, integrator="implicit_euler"):
    stepper = make_stepper(scene, mesh, integrator=INTEGRATORS[integrator](), forces=True)
    return stepper, list(direct(stepper, Start.at_rest(mesh.points, np.zeros_like(mesh.points)), scene.steps))


MESH = block((0.0, 0.0), (SIDE, SIDE), 4)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_throw_keeps_the_momentum_that_it_has_when_it_is_let_go(integrator):
    scene = pulled(times=(0.0, 0.1, 0.15), points=((0.1, 0.2), (0.4, 0.5), (0.6, 0.7)), gravity=0.0)
    stepper, reports = march(scene, MESH, integrator)
    momenta = [masses(stepper) @ report.velocity for report in reports]
    assert np.linalg.norm(momenta[14]) > 1.0 * MASS
    if integrator == "implicit_euler":  # momentum is the impulse of the pull's force
        impulses = np.cumsum([DT * report.forces["pull"].sum(axis=0) for report in reports], axis=0)
        np.testing.assert_allclose(momenta, impulses, atol=1e-7 * MASS)
    np.testing.assert_allclose(momenta[15:], np.tile(momenta[14], (25, 1)), atol=1e-6 * MASS)
    assert [bool(np.any(report.forces["pull"])) for report in reports] == [True] * 15 + [False] * 25


@pytest.mark.parametrize("young", [3e3, 1e5, 1e8])
def test_the_force_is_bounded_by_softness_and_weight(young):
    scene = pulled(((0.1, 0.2), (50.0, 60.0)), (0.0, 0.1), steps=10)
    body = replace(scene.bodies[0], material=replace(STIFF, young=young))
    _, reports = march(replace(scene, bodies=(body,)), MESH)
    forces = [np.linalg.norm(report.forces["pull"].sum(axis=0)) / WEIGHT for report in reports]
    most = {3e3: LEAST_WEIGHTS, 1e8: MOST_WEIGHTS}.get(young, max(forces))
    assert 0.9 * most < max(forces) <= most * (1.0 + 1e-9) and LEAST_WEIGHTS <= max(forces) * 1.1 <= 1.1 * MOST_WEIGHTS


def test_the_patch_comes_in_time_and_stays():
    """Without gravity and within a part of the spring's length, a rigid body comes by critical damping."""
    point = np.array([0.1, 0.24])
    _, reports = march(pulled((point, point), (0.0, 1.0), gravity=0.0, steps=100), MESH)
    top = np.array([report.positions[np.isclose(MESH.points[:, 1], SIDE)].mean(axis=0) for report in reports])
    left = np.linalg.norm(top - point, axis=1) / 0.04
    assert left[round(0.5 * REACH / DT)] > 0.2 and left[round(REACH / DT)] < 0.2
    assert left[40:].max() < 0.05


def test_one_that_does_not_act_adds_nothing():
    """The same bits before it begins as without it, and after its end no entry of the matrix."""
    scene = pulled(times=(0.1, 0.15, 0.2), steps=30)
    stepper, reports = march(scene, MESH, "bdf2")
    _, without = march(replace(scene, pulls=()), MESH, "bdf2")
    for number in range(9):
        np.testing.assert_array_equal(reports[number].positions, without[number].positions)
    assert np.abs(reports[12].positions - without[12].positions).max() > 1e-5
    assert [step for step in range(1, 30) if stepper.model.begins_anew(step)] == [10, 20]
    (term,) = [term for term in stepper.potential.terms if term.name == "pull"]
    assert len(term._points) == 0


@pytest.mark.parametrize("d", [2, 3])
def test_levels_share_the_patch(d):
    place = (0.0,) + (0.5,) * (d - 1)
    pull = Pull("body 0", place, (0.0, 1.0), [place, place], radius=0.3)
    scene = make_scene((STIFF,), pulls=(pull,))
    coarse, fine = (block((0.0,) * d, (1.0,) * d, n) for n in (4, 7))
    found = [Pulls(scene, coarse, mesh).bound(pull) for mesh in (coarse, fine)]
    for bound, mesh in zip(found, (coarse, fine), strict=True):
        points, shares, _ = bound
        assert shares.sum() == pytest.approx(1.0) and shares.min() > 0.0
        np.testing.assert_allclose(shares @ mesh.points[points], place, atol=0.05)
    first, second = (b[1] @ mesh.points[b[0]] for b, mesh in zip(found, (coarse, fine), strict=True))
    np.testing.assert_allclose(first, second, atol=1e-12)
    assert found[0][2] == found[1][2]


def test_points_and_offsets_are_exact_at_keys(tmp_path):
    random = np.random.default_rng(0)
    times, points = np.arange(60) * DT, random.uniform(-1.0, 1.0, (60, 3))
    pull = Pull("a", (0.0, 0.0, 0.0), times, points)
    file = tmp_path / "hand.jsonl"
    lines = [{"step": n + 1, "pulls": [], "obstacles": {"o": p.tolist()}} for n, p in enumerate(points)]
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))
    led = Led(Still(), "o", Hand(file), DT)
    for n in range(60):
        np.testing.assert_array_equal(pull.at(n * DT), points[n])
        np.testing.assert_array_equal(led(np.zeros((1, 3)), (n + 1) * DT)[0], points[n])
    np.testing.assert_allclose(led.offset(7.25 * DT, 3), 0.75 * points[6] + 0.25 * points[7])
    np.testing.assert_array_equal(led.offset(99.0, 3), points[-1])
