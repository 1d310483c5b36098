"""Drift feedback: closed forms of its decay, of its momentum and of what it does to a body that contact holds; held
vertices and steps at rest.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from pdvol.geometry.rigid_motions import mass_centres
from pdvol.integrate.feedback import level_feedback
from pdvol.integrate.integrator import past_of
from pdvol.integrate.marches import Start, progressive
from pdvol.integrate.stepper import FromCoarser, Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.potentials.potential import Positions
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Gravity, NeoHookean, Plane, Solver, Support, Translation
from problems import SOFT, block, make_scene
from shapes import together

DT, BETA, G = 0.01, 0.3, 9.81
AT = 3.0  # m: where the second of two blocks begins


def blocks(n, d, count=1):
    return together(*(block((AT * i,) + (0.0,) * (d - 1), (AT * i + 1.0,) + (1.0,) * (d - 1), n) for i in range(count)))


def turn(angle, d):
    """A rotation in the first two axes."""
    R = np.eye(d)
    R[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return R


class Pair:
    """A coarse level whose places are given, and a fine one that follows it with feedback."""

    def __init__(self, path, d=2, count=1, beta=BETA, integrator=None, **physics):
        self.levels = Hierarchy([blocks(1, d, count), blocks(2, d, count)], MPI.COMM_WORLD)
        self.coarse, self.fine = (self.levels[i].mesh for i in (0, 1))
        physics = {"dt": DT, "materials": (SOFT,) * count} | physics
        scene = replace(make_scene(**physics), feedback=beta)
        self.model = level_model(scene, self.levels, 1, 1.0, placed_obstacles(scene.obstacles))
        self.path = lambda step: path(step, self.coarse.points)
        (self.feedback,) = level_feedback(self.model, self.levels, "progressive", self.path)
        self.stepper = Stepper(self.model, self.levels[1], FromCoarser(feedback=(self.feedback,)), integrator)
        self.masses = self.levels[1].to_input(self.stepper.potential.mass)[:, 0]

    def march(self, start, steps):
        """Reports from positions (n, d) or from a `Start`."""
        start = start if isinstance(start, Start) else Start.at_rest(start, 0.0 * start)
        below = lambda step: past_of(self.stepper.integrator, self.path, 0.0 * self.path(0), step, DT)
        return list(progressive(self.stepper, self.levels.prolongation(1), below, start, steps))


FALLEN = {  # a fall from rest, over g dt^2, after so many steps (test_integrators.py)
    "implicit_euler": lambda step: step * (step + 1) / 2,
    "bdf2": lambda step: step**2 / 2 + 0.75 * (1 - 3.0**-step),
}


@pytest.mark.parametrize("name", INTEGRATORS)
@pytest.mark.parametrize("d", [2, 3])
def test_a_distance_in_flight_shrinks_by_the_same_share_in_each_step(d, name):
    """Level 0 falls, level 1 begins 0.3 m beside it: after t steps (1 - beta)^t of that are left. The momentum that it
    lacks beside level 0's is beta (1 - beta)^(t - 1) M 0.3 m / dt in step t, and all steps together move it by 0.3 m.
    """
    aside, steps, down = 0.3 * np.eye(d)[0], 6, -G * np.eye(d)[-1]
    fall = lambda step, X: X + FALLEN[name](step) * DT**2 * down
    pair = Pair(fall, d, integrator=INTEGRATORS[name](), loads=(Gravity(tuple(down)),))
    lifted = lambda step: pair.levels.prolongation(1).prolong(pair.path(step))
    before, moved, mass = pair.fine.points + aside, 0.0, pair.masses.sum()
    for t, report in enumerate(pair.march(before, steps), start=1):
        left = (1 - BETA) ** t * aside
        np.testing.assert_allclose(report.positions - lifted(t), np.tile(left, (len(before), 1)), atol=1e-8)
        lacks = pair.masses @ (report.positions - before - lifted(t) + lifted(t - 1)) / DT
        np.testing.assert_allclose(lacks, -BETA * (1 - BETA) ** (t - 1) * mass * aside / DT, atol=1e-5 * mass)
        moved, before = moved + lacks * DT / mass, report.positions
    np.testing.assert_allclose(moved, -(1 - (1 - BETA) ** steps) * aside, atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_a_turn_shrinks_and_nothing_is_deformed(d):
    """An angle a becomes that of (1 - beta) exp(i a) + beta: for small ones, (1 - beta) a."""
    pair, angle = Pair(lambda step, X: X, d), 1.2
    centre = mass_centres(pair.fine.points, pair.masses, pair.fine.point_bodies)
    for report in pair.march(centre + (pair.fine.points - centre) @ turn(angle, d).T, 12):
        angle = np.angle((1 - BETA) * np.exp(1j * angle) + BETA)
        expected = centre + (pair.fine.points - centre) @ turn(angle, d).T
        np.testing.assert_allclose(report.positions, expected, atol=1e-7)
        assert report.energy["elastic"] < 1e-9
    assert angle == pytest.approx(1.2 * (1 - BETA) ** 12, rel=0.25)


@pytest.mark.parametrize("d", [2, 3])
def test_the_whole_share_is_exact_on_rigid_motions_body_by_body(d):
    """beta = 1 leads two bodies, each moved in its own way, exactly to the prolonged level below."""

    def path(step, X):
        second = X[:, 0] >= AT
        return np.where(second[:, None], X @ turn(0.7, d).T + 0.2, X @ turn(-1.9, d).T - 0.4)

    pair = Pair(path, d, count=2, beta=1.0)
    x = pair.fine.points @ turn(0.4, d).T + 1.0
    np.testing.assert_allclose(x + pair.feedback(0, x), pair.levels.prolongation(1).prolong(pair.path(0)), atol=1e-7)
    squeezed = Pair(lambda step, X: 0.5 + (X - 0.5) * 0.8, d)  # smaller about its centre: the shape is left alone
    np.testing.assert_allclose(squeezed.feedback(0, squeezed.fine.points), 0.0, atol=1e-9)


def test_supports_are_kept_exactly():
    """The first of two blocks is held at its left side, by a motion, until t = 4 dt. It is not pushed as a whole, and
    what holds it is where the motion has it; the second one is drawn to the level below.
    """
    aside, speed = np.array([0.0, 0.1]), np.array([0.2, 0.0])
    hold = Support(lambda X: X[:, 0] < 1e-9, motion=Translation(tuple(speed)), release=4 * DT)
    pair = Pair(lambda step, X: X + aside, count=2, supports=(hold,))
    x, first = pair.fine.points, pair.fine.point_bodies == 0
    held = x[:, 0] < 1e-9
    during, after = (pair.feedback(step, x) for step in (3, 4))
    np.testing.assert_array_equal(during[first], 0.0)
    np.testing.assert_allclose(during[~first], BETA * np.tile(aside, ((~first).sum(), 1)), atol=1e-9)
    np.testing.assert_allclose(after, BETA * np.tile(aside, (len(x), 1)), atol=1e-9)
    for report in pair.march(x, 4):
        np.testing.assert_allclose(report.positions[held], x[held] + report.step * DT * speed, rtol=0.0, atol=1e-15)


# ---- where contact holds


def held_by_the_floor(lowered, **more):
    """A stiff block on a floor; the level below is `lowered(step)` [m] lower. It pushes the block into the floor."""
    more = {
        "materials": (NeoHookean(1e8, 0.3, 1000.0),),
        "obstacles": (Plane((0.0, -1.9e-3), (0.0, 1.0)),),
        "loads": (Gravity((0.0, -G)),),
        "contact": (Barrier(dhat=2e-3, stiffness=1.0),),
        "solver": Solver(tolerance=1e-4, linear="direct"),
    } | more
    return Pair(lambda step, X: X - [0.0, lowered(step)], **more)


@pytest.mark.parametrize(("name", "weight"), [("implicit_euler", DT**2), ("bdf2", (2 * DT / 3) ** 2)])
def test_contact_answers_with_a_force_like_a_weight(name, weight):
    """The block comes to rest where the floor carries M (g + beta / weight distance), to the tolerance."""
    settings = {"solver": Solver(tolerance=1e-6, linear="direct"), "integrator": INTEGRATORS[name]()}
    pair = held_by_the_floor(lambda step: 2e-3, **settings)
    end = pair.march(pair.fine.points, 60)[-1].positions
    barrier, space = pair.stepper.potential.contacts[0], pair.levels[1]
    force = -space.to_input(barrier.gradient(Positions(space, space.from_input(end))))[:, 1].sum()
    lifted = pair.levels.prolongation(1).prolong(pair.path(60))
    distance = pair.masses @ (end - lifted)[:, 1] / pair.masses.sum()
    assert distance > 1e-3
    push = BETA / weight * distance
    assert push > 3.0, "as large as a third of the weight"
    assert force == pytest.approx(pair.masses.sum() * (G + push), rel=1e-3)


def test_a_level_below_that_creeps_leads_what_contact_holds():
    """0.05 mm/s is below the tolerance, but its sum is not: the block follows it."""
    creep = lambda step: 2e-3 + max(0, step - 60) * 0.05e-3 * DT
    pair = held_by_the_floor(creep)
    reports = pair.march(pair.fine.points, 400)
    assert reports[-1].positions[:, 1].mean() < reports[99].positions[:, 1].mean() - 1e-6
