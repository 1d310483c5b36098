"""Marches that a coarser level guides: closed forms of free rigid motion, where P is exact and nothing deforms."""

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.integrate.integrator import ImplicitEuler, State, advance, past_of
from pdvol.integrate.marches import SAME_TIME, Start, direct, embedded, guide, mean_of_forces, progressive
from pdvol.integrate.stepper import FromCoarser, Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.registry import INTEGRATORS
from problems import SOFT, block, fail_solve, make_scene

DT, STEPS, W = 0.1, 4, 0.3
SHIFT = np.array([0.5, -0.2])  # m, per step and step: the coarse level is at t^2 SHIFT after t steps


@pytest.fixture(scope="module")
def pair():
    """A coarse and a fine square, the scene, and where the coarse one is after each step."""
    coarse, fine = block((0.0, 0.0), (1.0, 1.0), 1), block((0.0, 0.0), (1.0, 1.0), 3, jitter=0.1)
    levels = Hierarchy([coarse, fine], MPI.COMM_WORLD)
    return (
        levels,
        fine,
        make_scene((SOFT,), dt=DT, steps=STEPS),
        [coarse.points + t**2 * SHIFT for t in range(STEPS + 1)],
    )


def places(reports, rest):
    """How far each step's positions are shifted, which all vertices must be alike."""
    shifts = np.array([report.positions - rest for report in reports])
    np.testing.assert_allclose(shifts, shifts[:, :1].repeat(len(rest), axis=1), atol=1e-8)
    return shifts[:, 0]


def guided(levels, scene, path, integrator, **more):
    guides = (guide(W, DT, levels.prolongation(1), path.__getitem__),)
    return Stepper(level_model(scene, levels, 1, 1.0), levels[1], FromCoarser(guides=guides), integrator, **more)


def pulled(integrator, past, by, t):
    """The past of a point with the past `by` for its prediction, one step later: x+ = (x_hat + 2 w r target) / (1 + 2 w
    r), where r is the step's weight over dt^2.
    """
    w = W * integrator.weight(by, DT) / DT**2
    return advance(integrator, past, (integrator.predict(by, DT) + 2 * w * t**2 * SHIFT) / (1 + 2 * w), DT)


AT_REST = (State(np.zeros(2), np.zeros(2)),)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_tracks(pair, name):
    levels, fine, scene, path = pair
    integrator, start = INTEGRATORS[name](), Start.at_rest(fine.points, np.zeros_like(fine.points))
    reports = list(direct(guided(levels, scene, path, integrator), start, STEPS))
    expected, past = [], AT_REST
    for t in range(1, STEPS + 1):
        past = pulled(integrator, past, past, t)
        now = past[0].positions
        expected.append(now)
        energy = W / DT**2 * 1000.0 * fine.volumes.sum() * np.sum((now - t**2 * SHIFT) ** 2)
        assert reports[t - 1].energy["consistency"] == pytest.approx(energy, rel=1e-5)
    np.testing.assert_allclose(places(reports, fine.points), expected, atol=1e-7)


def changed(integrator, coarse, number):
    """By the mean of the coarse level's forces."""
    change = mean_of_forces(integrator, coarse, number, DT)
    return np.zeros(2) if change is None else change


@pytest.mark.parametrize("name", INTEGRATORS)
def test_progressive_with_consistency(pair, name):
    """The prediction is x + (x_hat_c - x_c) and the mean of forces, from the states of the coarse level alone."""
    levels, fine, scene, path = pair
    integrator, start = INTEGRATORS[name](), Start.at_rest(fine.points, np.zeros_like(fine.points))
    below = lambda step: past_of(integrator, path.__getitem__, np.zeros_like(path[0]), step, DT)
    reports = list(progressive(guided(levels, scene, path, integrator), levels.prolongation(1), below, start, STEPS))
    expected, past = [], AT_REST
    coarse = lambda step: past_of(integrator, lambda n: n**2 * SHIFT, np.zeros(2), step, DT)
    for t in range(1, STEPS + 1):
        now, seen = past[0].positions, coarse(t - 1)
        x_hat = now + (integrator.predict(seen, DT) - seen[0].positions) + changed(integrator, coarse, t)
        w = W * integrator.weight(seen, DT) / DT**2
        past = advance(integrator, past, (x_hat + 2 * w * t**2 * SHIFT) / (1 + 2 * w), DT)
        expected.append(past[0].positions)
    np.testing.assert_allclose(places(reports, fine.points), expected, atol=1e-7)
    if name == "implicit_euler":  # VelPro: x_hat = x + (x_c - x_c-)
        now = expected[0]
        for t in range(2, STEPS + 1):
            now = (now + (2 * t - 3) * SHIFT + 2 * W * t**2 * SHIFT) / (1 + 2 * W)
            np.testing.assert_allclose(expected[t - 1], now, atol=1e-12)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_cut_step_goes_by_the_coarse_velocity(pair, name, monkeypatch):
    """The third step fails once as a whole. Its halves are of implicit Euler, with the coarse velocity P v_c at their
    start and the displacement of the first half after it: a free level moves by dt P v_c and the mean of forces.
    """
    levels, fine, scene, path = pair
    integrator = INTEGRATORS[name]()
    below = lambda step: past_of(integrator, path.__getitem__, np.zeros_like(path[0]), step, DT)
    stepper = Stepper(level_model(scene, levels, 1, 1.0), levels[1], integrator=integrator)
    fail_solve(monkeypatch, stepper, 3)
    start = Start.at_rest(fine.points, np.zeros_like(fine.points))
    reports = list(progressive(stepper, levels.prolongation(1), below, start, STEPS))
    assert [report.cuts for report in reports] == [0, 0, 1, 0]
    now = np.zeros(2)
    for t, shift in enumerate(places(reports, fine.points), start=1):
        seen = below(t - 1)
        change = changed(integrator, below, t)
        whole = (integrator.predict(seen, DT) - seen[0].positions + change)[0]
        now = now + (DT * seen[0].velocity[0] + np.reshape(change, (-1, 2))[0] if t == 3 else whole)
        np.testing.assert_allclose(shift, now, atol=1e-7)


def test_embedded(pair):
    levels, fine, scene, path = pair
    asked = []

    def count(positions, time):
        asked.append(time)
        return 7 * len(asked)

    given = levels.prolongation(1), path.__getitem__, 1
    start = lambda step: Start(step, (State(fine.points, fine.points),))
    march = lambda step: embedded(*given, start(step), STEPS, DT, ImplicitEuler(), count)
    reports = list(march(0))
    assert [(r.level, r.step, r.intersections, r.reason) for r in reports] == [
        (1, t, 7 * t, "EMBEDDED") for t in range(1, STEPS + 1)
    ]
    np.testing.assert_allclose(asked, DT * np.arange(1, STEPS + 1))
    for t, report in enumerate(reports, start=1):
        np.testing.assert_array_equal(report.positions, levels.prolongation(1).prolong(path[t]))
        np.testing.assert_allclose(report.positions, fine.points + t**2 * SHIFT, atol=1e-12)
    assert [r.step for r in march(2)] == [3, 4]


def test_a_guide_goes_straight_between_coarse_steps(pair):
    levels, _, _, path = pair
    held = guide(W, DT, levels.prolongation(1), path.__getitem__)
    assert held.stiffness == pytest.approx(W / DT**2)
    P = levels.prolongation(1).prolong
    for step in range(STEPS + 1):
        np.testing.assert_array_equal(held.target(step * DT), P(path[step]))  # exactly, and never beyond the last state
    for time in (DT * (2.0 - 0.1 * SAME_TIME), DT * (2.0 + 0.1 * SAME_TIME), STEPS * DT * (1.0 + 1e-15)):
        np.testing.assert_array_equal(held.target(time), P(path[round(time / DT)]))  # times are sums, with round-off
    np.testing.assert_allclose(held.target(2.25 * DT), P(0.75 * path[2] + 0.25 * path[3]), atol=1e-14)
