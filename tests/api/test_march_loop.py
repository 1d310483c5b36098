"""`pdvol.march`: the steps of a run, one by one in memory; own terms, own integrators, and messages about them."""

import os
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import own_parts
import pytest
import small

import pdvol
from commands import SAFETY
from on_ranks import ENVIRONMENT
from pdvol import InputError, Solver
from pdvol.registry import INTEGRATORS, METHODS

EXACT = Solver(tolerance=1e-9, linear="direct")
G = 9.81


def falling(dt: float, steps: int, levels: int = 1) -> pdvol.Scene:
    return replace(replace(small.scene(levels), obstacles=(), contact=(), solver=EXACT), dt=dt, steps=steps)


# ---- the steps of a run


@pytest.mark.parametrize(
    ("method", "integrator"), [("progressive", "implicit_euler"), *((method, "bdf2") for method in METHODS)]
)
def test_steps_are_those_of_a_run(method, integrator):
    scene = replace(small.scene(3, 4), penalty=pdvol.Penalty(weight=0.1), feedback=0.1, integrator=integrator)
    run, seen = pdvol.run(scene, method=method), []
    for step in pdvol.march(scene, method=method):
        stored = run.levels[step.level]
        np.testing.assert_array_equal(step.positions, stored.positions(step.step))
        if integrator == "implicit_euler":
            np.testing.assert_array_equal(step.velocity, stored.velocities(step.step))
        assert step.time == pytest.approx(step.step * scene.dt)
        record = next(r for r in stored.log if r["step"] == step.step)
        assert step.report.newton_iterations == record["newton_iterations"]
        seen.append((step.level, step.step))
    assert seen == [(level, step) for level in range(3) for step in (1, 2, 3, 4)]


@pytest.mark.parametrize("name", INTEGRATORS)
def test_nothing_is_differenced_over_a_jump(name):
    """A body that a support lets go in the fourth step falls as from rest, on each level. One that an impulse hits, in
    the first step or later, has the whole velocity in that step, and keeps it.
    """
    dt, steps = 0.1, 8
    hold = pdvol.Support(lambda X: np.ones(len(X), dtype=bool), release=0.3)
    free = replace(falling(dt, steps, levels=2), integrator=name)
    fallen = {"implicit_euler": lambda n: n * (n + 1) / 2, "bdf2": lambda n: n**2 / 2 + 0.75 * (1 - 3.0**-n)}[name]
    for step in pdvol.march(replace(free, supports=(hold,))):
        moved = step.positions - step.model.start
        np.testing.assert_allclose(moved[:, 1], -G * dt**2 * fallen(max(0.0, step.step - 3.0)), atol=1e-7)
    for first, time in ((1, 0.0), (4, 0.3)):  # 0.3 < 3 * 0.1, by round-off
        hit = pdvol.Impulse((1.0, 2.0), time)
        for step in pdvol.march(replace(free, loads=(hit,))):
            n = max(0, step.step - first + 1)
            along = np.broadcast_to([1.0, 2.0], step.velocity.shape)
            np.testing.assert_allclose(step.positions - step.model.start, n * dt * along, atol=1e-7)
            np.testing.assert_allclose(step.velocity, along if n else 0.0 * along, atol=1e-6)


def test_forces_balance():
    """Forces sum to zero where nothing is held; there the support gives what is left. Gravity is the weight."""
    held = pdvol.Support(lambda X: X[:, 0] < 1e-9)
    for step in pdvol.march(replace(small.scene(steps=6), supports=(held,), solver=EXACT)):
        assert set(step.forces) == {"inertia", "elastic", "load", "barrier", "friction"}
        total, largest = sum(step.forces.values()), max(np.abs(rows).max() for rows in step.forces.values())
        free = step.model.free
        assert np.abs(total[free]).max() < 1e-4 * largest < np.abs(total[~free]).max()
        weight = step.forces["load"].sum(axis=0)
        np.testing.assert_allclose(weight, [0.0, -G * 1000.0], rtol=1e-9, atol=1e-9)
    assert step.report.contacts > 0 and np.abs(step.forces["friction"]).max() > 0.0


def test_an_own_term_may_begin_to_move_what_rests():

    class Late(own_parts.Hand):
        def begin_step(self, x_t, t0, t1, x_hat=None):
            self.goal = self.start + [0.0, 0.5 * (t1 > 0.1)]

    alone = replace(small.scene(), loads=(), obstacles=(), contact=(), solver=EXACT, steps=8)
    *_, last = pdvol.march(alone, levels=0, terms=(Late,))
    assert (last.positions - last.model.start)[:, 1].min() > 0.01


# ---- own integrators


def fall_error(integrator, exact, steps: int) -> float:
    *_, last = pdvol.march(falling(0.5 / steps, steps), integrator=integrator)
    return float(np.abs((last.positions - last.model.start)[:, 1] - exact).max())


def test_free_fall_has_the_order_of_an_own_integrator():
    """With drag c: y'' = -g - c y', so y = -g/c (t - (1 - exp(-c t)) / c)."""
    c, t = 3.0, 0.5
    exact = -G / c * (t - (1.0 - np.exp(-c * t)) / c)
    errors = [fall_error(own_parts.DampedEuler(c), exact, steps) for steps in (10, 20, 40)]
    slope = -np.polyfit(np.log([10, 20, 40]), np.log(errors), 1)[0]
    assert 0.9 < slope < 1.1
    assert fall_error(own_parts.Parabola(), -G * t**2 / 2.0, 5) < 1e-8 < fall_error(None, -G * t**2 / 2.0, 5)


@pytest.mark.parametrize("method", METHODS)
def test_an_own_integrator_marches_all_levels_by_any_method(method):
    """Finer levels fall as exactly as it does: by its prediction, and by velocities that use those of the past."""
    scene = replace(falling(0.1, 5, 2), penalty=pdvol.Penalty(weight=0.1), feedback=0.1)
    ends = [s for s in pdvol.march(scene, method=method, integrator=own_parts.Parabola()) if s.step == 5]
    assert [end.level for end in ends] == [0, 1]
    for end in ends:
        np.testing.assert_allclose((end.positions - end.model.start)[:, 1], -G * 0.5**2 / 2.0, atol=1e-8)
        np.testing.assert_allclose(end.velocity[:, 1], -G * 0.5, atol=1e-6)


# ---- messages


class Bare(pdvol.Term):
    name = "bare"

    def __init__(self, model, space):
        self.space = space

    def value(self, x):
        return 0.0

    def gradient(self, x):
        return np.zeros_like(x.owned)


def bare(**wrong):
    """A term of which something is wrong."""
    return type("Wrong", (Bare,), wrong)


def parabola(**wrong):
    """An integrator of which something is wrong."""
    return type("Wrong", (own_parts.Parabola,), wrong)()


def fails(*_):
    raise ZeroDivisionError("an own mistake")


def lost(self, x):
    return np.full_like(x.owned, np.nan) if np.abs(x.owned).max() > 1.05 else np.zeros_like(x.owned)


SHORT = parabola(predict=lambda self, past, dt: past[0].positions[0])


@pytest.mark.parametrize(
    "message, wrong",
    [
        ("pdvol.march takes a pdvol.Scene, not str", {"scene": "drop.py"}),
        ("level 1 follows from level 0; begin with levels 0:1", {"levels": (1, 1)}),
        ("terms are functions or classes (model, space) -> Term, not 3", {"terms": (3,)}),
        ("gave a int, not a pdvol.Term", {"terms": (lambda model, space: 3,)}),
        ("the term 'bare': value must be a number, not str", {"terms": (bare(value=lambda *_: "much"),)}),
        (
            "the term 'bare': gradient must have the shape (9, 2), not (9,)",
            {"terms": (bare(gradient=lambda self, x: np.zeros(len(x.owned))),)},
        ),
        ("the integrator int has no states, predict, weight, velocity", {"integrator": 3, "levels": 0}),
        ("integrator.predict must give an array of shape (9, 2), not (2,)", {"integrator": SHORT, "levels": 0}),
        ("integrator.weight = 0.0 must be positive", {"integrator": parabola(weight=lambda *_: 0.0), "levels": 0}),
        (
            "integrator.velocity failed: ZeroDivisionError: an own",
            {"integrator": parabola(velocity=fails), "levels": 0},
        ),
    ],
)
def test_bad_arguments_are_refused_in_one_line(message, wrong):
    with pytest.raises(InputError) as caught:
        list(pdvol.march(**{"scene": small.scene(), **wrong}))
    assert message in str(caught.value) and "\n" not in str(caught.value)


def test_what_an_own_term_does_later_is_named():
    scene = replace(falling(0.1, 5), bodies=(replace(small.scene(1).bodies[0], velocity=(1.0, 0.0)),))
    with pytest.raises(pdvol.ConvergenceError, match="level 0, step .*the bare term's gradient is not a number"):
        list(pdvol.march(scene, terms=(bare(gradient=lost),)))
    with pytest.raises(ZeroDivisionError, match="an own mistake"):
        list(pdvol.march(falling(0.1, 2), terms=(bare(add_hessian=fails),)))


# ---- ranks


FULL = """
import numpy as np
import pdvol
from mpi4py import MPI


class Full(pdvol.Term):
    def value(self, x):
        return 0.0

    def gradient(self, x):
        return np.zeros_like(x.owned)

    def begin_step(self, x_t, t0, t1, x_hat=None):
        if t0 > 0.0 and MPI.COMM_WORLD.rank == 1:
            raise MemoryError("no memory left for contacts")


cube = pdvol.Body(pdvol.meshes.box(), pdvol.NeoHookean(1e5), (60,))
shot = pdvol.Scene((cube,), dt=0.01, steps=3, loads=(pdvol.Gravity((0, 0, -9.81)),))
for step in pdvol.march(shot, levels=0, terms=(lambda model, space: Full(),)):
    print(f"step {step.step}", flush=True)
"""


@pytest.mark.mpi
def test_memory_that_runs_out_on_one_rank_ends_all(tmp_path):
    mpirun = shutil.which("mpirun") or pytest.skip("there is no mpirun")
    (tmp_path / "full.py").write_text(FULL)
    words = [mpirun, "-n", "2", sys.executable, str(tmp_path / "full.py")]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=SAFETY, env=os.environ | ENVIRONMENT)
    assert ended.returncode != 0 and "step 1" in ended.stdout and "step 2" not in ended.stdout
    assert "no memory left for contacts" in ended.stderr
