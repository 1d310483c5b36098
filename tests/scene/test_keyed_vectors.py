"""Vectors by keyframes: gravity that turns, a wind that rises."""

import numpy as np
import pytest

import pdvol
from pdvol import (
    Body,
    Flow,
    Force,
    Gravity,
    Impulse,
    InputError,
    Keyed,
    Muscle,
    NeoHookean,
    PointForce,
    Pressure,
    Scene,
    Solver,
    meshes,
)

RAMP, END = 30.0, 0.2  # gravity grows by this [m/s^3] for so long [s]
TURNING = Keyed((0.0, 0.1), ((0.0, -10.0, 0.0), (0.0, 0.0, -10.0)))


def test_vectors_between_keys():
    np.testing.assert_array_equal(TURNING(-1.0), (0.0, -10.0, 0.0))
    np.testing.assert_allclose(TURNING(0.025), (0.0, -7.5, -2.5))
    np.testing.assert_array_equal(TURNING(7.0), (0.0, 0.0, -10.0))
    same = Keyed([0, 0.1], np.array(TURNING.values))
    assert same == TURNING and hash(same) == hash(TURNING)
    flow = Flow(Keyed((0.0, 1.0), ((0.0, 0.0), (2.0, 4.0))))
    np.testing.assert_allclose(flow.at(np.zeros((3, 2)), 0.5), [[1.0, 2.0]] * 3)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Keyed((0.0, 1.0), ((0.0, 1.0), (0.0, 1.0, 2.0))), "as many components each"),
        (lambda: Keyed((0.0, 1.0), ((0.0, 1.0), (0.0, np.inf))), "is not a finite number"),
        (lambda: Keyed((0.0, 1.0), ((0.0, 1.0), 3.0)), "must have two or three components"),
        (lambda: Gravity(Keyed((0.0, 1.0), (0.0, 1.0))), r"Gravity\.acceleration is a vector: give Keyed vectors"),
        (lambda: Force(Keyed((0.0, 1.0), (0.0, 1.0))), r"Force\.force is a vector"),
        (lambda: PointForce(Keyed((0.0, 1.0), (0.0, 1.0)), (0.0, 0.0)), r"PointForce\.force is a vector"),
        (lambda: Flow(Keyed((0.0, 1.0), (0.0, 1.0))), r"Flow\.velocity is a vector"),
        (lambda: NeoHookean(TURNING), "young is a number: give Keyed numbers"),
        (lambda: Pressure("body", TURNING), r"Pressure\.pressure is a number: give Keyed numbers"),
        (lambda: Muscle("body", (1.0, 0.0), 1.0, TURNING), r"Muscle\.activation is a number: give Keyed numbers"),
        (lambda: Muscle("body", (1.0, 0.0), 1.0, Keyed((0.0, 1.0), (0.0, -1.0))), "its lowest key, = -1.0 is below 0"),
        (lambda: Muscle("body", TURNING, 1.0), r"Muscle\.fibre cannot be Keyed; activation can"),
        (lambda: Impulse(TURNING), r"Impulse\.velocity = .* must have two or three components"),
    ],
)
def test_what_does_not_fit_is_one_line(make, said):
    with pytest.raises(InputError, match=said) as caught:
        make()
    assert "\n" not in str(caught.value)


def fallen(tmp_path, steps, integrator):
    """Time step [s], and positions and velocities [m, m/s] of a free body after so many steps of a linear ramp of
    gravity, from their backward differences.
    """
    dt = END / steps
    gravity = Gravity(Keyed((0.0, END), ((0.0, 0.0, 0.0), (0.0, 0.0, RAMP * END))))
    body = Body((meshes.brick(),), NeoHookean(1e5))
    scene = Scene((body,), dt, steps, loads=(gravity,), integrator=integrator, solver=Solver(tolerance=1e-9))
    level = pdvol.run(scene, tmp_path / f"{integrator}_{steps}", method="direct").levels[0]
    x = [level.positions(step) - level.rest for step in (steps, steps - 1, steps - 2)]
    assert max(np.ptp(at, axis=0).max() for at in x) < 1e-9, "it falls as one"
    euler = (x[0] - x[1]) / dt
    v = euler if integrator == "implicit_euler" else (3.0 * x[0] - 4.0 * x[1] + x[2]) / (2.0 * dt)
    np.testing.assert_allclose(level.velocities(steps), euler, atol=1e-12)
    return dt, x[0].mean(axis=0), v.mean(axis=0)


def sums(integrator, dt, n):
    """z and v_z after n steps of the integrator's own formula, by hand. With g(t) = a t:

    implicit Euler    v_n = a dt^2 n (n + 1) / 2,    x_n = a dt^3 n (n + 1) (n + 2) / 6
    BDF2              3 v_n - 4 v_{n-1} + v_{n-2} = 2 dt g_n after v_1 = a dt^2, so
                      v_n = a dt^2 (n^2 / 2 + 3/4 (1 - 3^-n)),
                      and 3 x_n - 4 x_{n-1} + x_{n-2} = 2 dt v_n after x_1 = a dt^3
    """
    if integrator == "implicit_euler":
        return RAMP * dt**3 * n * (n + 1) * (n + 2) / 6, RAMP * dt**2 * n * (n + 1) / 2
    speed = lambda k: RAMP * dt**2 * (k**2 / 2 + 0.75 * (1.0 - 3.0**-k))
    before, x = 0.0, RAMP * dt**3
    for k in range(2, n + 1):
        before, x = x, (4.0 * x - before + 2.0 * dt * speed(k)) / 3.0
    return x, speed(n)


@pytest.mark.parametrize(("integrator", "order"), [("implicit_euler", 1), ("bdf2", 2)])
def test_a_free_body_follows_a_ramp_of_gravity(tmp_path, integrator, order):
    """Its formula's sums to round-off, and the limits a t^3 / 6 and a t^2 / 2 by the integrator's order."""
    limits, off = np.array([RAMP * END**3 / 6, RAMP * END**2 / 2]), []
    for steps in (10, 20):
        dt, x, v = fallen(tmp_path, steps, integrator)
        np.testing.assert_allclose([x[:2], v[:2]], np.zeros((2, 2)), atol=1e-9)
        found = np.array([x[2], v[2]])
        np.testing.assert_allclose(found, sums(integrator, dt, steps), rtol=1e-8)
        off.append(np.abs(found - limits))
    np.testing.assert_allclose(np.log2(off[0] / off[1]), order, atol=0.15)


@pytest.mark.parametrize(
    ("gravity", "up"),
    [
        ((0.0, -9.81, 0.0), [0.0, 9.81, 0.0]),
        (Keyed((0.0, 0.5, 1.0), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 2.0, 0.0))), [0.0, -2.0, 0.0]),
        (lambda t: (0.0, 0.0, -9.81 * (t > 0.01)), [0.0, 0.0, 9.81]),
        (Keyed((0.0, 1.0), ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))), None),
        ((0.0, 0.0, 0.0), None),
    ],
)
def test_the_way_up_is_against_the_first_gravity_that_is_not_zero(tmp_path, gravity, up):
    scene = Scene((Body((meshes.brick(),), NeoHookean(1e5)),), 0.01, 2, loads=(Gravity(gravity),))
    stored = pdvol.run(scene, tmp_path / "run").info.get("up")
    assert stored == up and not any(np.signbit(x) and x == 0.0 for x in stored or ())


def test_a_keyed_activation_is_that_of_a_function():
    keyed = Muscle("body", (1.0, 0.0), 2e4, Keyed((0.0, 0.2), (0.0, 1.0)))
    asked = Muscle("body", (1.0, 0.0), 2e4, lambda t, X: np.full(len(X), min(5.0 * t, 1.0)))
    points = np.zeros((3, 2))
    for time in (-1.0, 0.0, 0.05, 0.2, 3.0):
        np.testing.assert_allclose(keyed.tension(time, points), asked.tension(time, points) if time >= 0 else 0.0)
