"""Time integrators: free fall, the past they are given, and what a cut step leaves."""

import numpy as np
import pytest

from pdvol.integrate.integrator import BDF2, ImplicitEuler, advance, past_of
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Impulse, Solver
from problems import block, fail_solve, make_scene, make_stepper, take_step, weight

G = 9.81


@pytest.mark.parametrize("integrator", [ImplicitEuler(), BDF2()], ids=["implicit_euler", "bdf2"])
@pytest.mark.parametrize("d", [2, 3])
def test_free_fall(d, integrator):
    """With a constant acceleration a the velocities are exact: a step of implicit Euler gives v + a dt, and the formula
    (3 v+ - 4 v + v-) / (2 dt) = a is exact where v is linear in time.

    Positions after a step of implicit Euler are off by another a dt^2 / 2. With BDF2 the first one's error obeys
    3 e+ - 4 e + e- = 0, whose roots are 1 and 1/3: e_n = 3/4 a dt^2 (1 - 3^-n).
    """
    dt, tolerance = 0.02, 1e-8
    up = np.eye(d)[-1]
    scene = make_scene(dt=dt, steps=8, loads=(weight(d),), solver=Solver(tolerance, linear="direct"))
    mesh, v0 = block((0.0,) * d, (0.4,) * d, 2, jitter=0.1), np.linspace(1.0, 2.0, d)
    start = Start.at_rest(mesh.points, np.tile(v0, (len(mesh.points), 1)))
    past, stepper = start.past, make_stepper(scene, mesh, integrator=integrator)
    for report in direct(stepper, start, scene.steps):
        past, t, n = advance(integrator, past, report.positions, dt), report.time, report.step
        off = n / 2.0 if isinstance(integrator, ImplicitEuler) else 0.75 * (1.0 - 3.0**-n)
        # Each step leaves speeds below the tolerance, and a velocity takes 3 + 4 + 1 halves of such moves.
        np.testing.assert_allclose(past[0].velocity, np.broadcast_to(v0 - G * t * up, mesh.points.shape), atol=1e-7)
        fall = v0 * t - G * (t**2 / 2.0 + off * dt**2) * up
        np.testing.assert_allclose(report.positions, mesh.points + fall, rtol=0.0, atol=1e-8)


# ---- the past


@pytest.mark.parametrize("name", INTEGRATORS)
def test_the_past_of_a_stored_step_is_the_one_of_the_march(name, monkeypatch):
    """To the last bit, or resumed runs would be others than uninterrupted ones. After steps 2 and 3, before and after
    an impulse, it has one state.
    """
    scene = make_scene(dt=0.013, steps=8, loads=(weight(2), Impulse((0.5, 0.0), time=2.5 * 0.013)))
    mesh = block((0.0, 0.0), (0.3, 0.3), 2, jitter=0.1)
    velocity = 2.0 * (mesh.points - 0.1) ** 2
    stepper, pasts = make_stepper(scene, mesh, integrator=INTEGRATORS[name]()), []
    step = stepper.step

    def keep(number, past):
        pasts.append(past)
        return step(number, past)

    monkeypatch.setattr(stepper, "step", keep)
    reports = list(direct(stepper, Start.at_rest(mesh.points, velocity), scene.steps))
    positions, asked = [mesh.points, *(report.positions for report in reports)], []

    def stored(number):
        asked.append(number)
        return positions[number]

    for done in (0, 1, 2, 3, 4, 7):
        found = past_of(stepper.integrator, stored, velocity, done, scene.dt, anew=stepper.model.begins_anew)
        assert len(found) == len(pasts[done]) == (1 if done in (0, 2, 3) else stepper.integrator.states)
        for mine, its in zip(found, pasts[done], strict=True):
            np.testing.assert_array_equal(mine.positions, its.positions)
            np.testing.assert_array_equal(mine.velocity, its.velocity)
        assert max(asked) == done and done - min(asked) < 2 * stepper.integrator.states
        asked.clear()


# ---- steps that are cut


def test_a_cut_step_ends_by_implicit_euler_and_bdf2_goes_on(monkeypatch):
    """The third step fails once as a whole. Its halves are steps of implicit Euler, which begin with the velocity that
    BDF2 gave.
    """
    dt, tolerance = 0.01, 1e-8
    solver = Solver(tolerance=tolerance, linear="direct")
    scene = make_scene(dt=dt, steps=5, loads=(weight(2),), solver=solver)
    mesh = block((0.0, 0.0), (0.3, 0.3), 2, jitter=0.1)
    start = Start.at_rest(mesh.points, 4.0 * (mesh.points - 0.1) ** 2)
    stepper = make_stepper(scene, mesh, integrator=BDF2())
    weights = fail_solve(monkeypatch, stepper, 3)
    reports = list(direct(stepper, start, scene.steps))
    assert [report.cuts for report in reports] == [report.remedies["halvings"] for report in reports] == [0, 0, 1, 0, 0]
    whole, half = (2.0 * dt / 3.0) ** 2, (dt / 2.0) ** 2
    np.testing.assert_allclose(weights, [dt**2, whole, whole, half, half, whole, whole], rtol=1e-14)

    positions = [mesh.points, *(report.positions for report in reports)]
    now = past_of(BDF2(), positions.__getitem__, start.past[0].velocity, 2, dt)[0]
    halves = make_stepper(make_scene(dt=dt / 2.0, loads=scene.loads, solver=solver), mesh)
    middle = take_step(halves, 1, now.positions, now.velocity).positions
    end = take_step(halves, 2, middle, (middle - now.positions) / (dt / 2.0)).positions
    np.testing.assert_allclose(reports[2].positions, end, rtol=0.0, atol=10.0 * tolerance * dt)

    # From there the march is the one that sets out from these states.
    past = past_of(BDF2(), positions.__getitem__, start.past[0].velocity, 3, dt)
    resumed = list(direct(make_stepper(scene, mesh, integrator=BDF2()), Start(3, past, reports[2].record()), 5))
    for one, other in zip(resumed, reports[3:], strict=True):
        np.testing.assert_array_equal(one.positions, other.positions)
