"""Bodies that lie still: a step costs an iteration or two, and no slow motion is lost."""

import numpy as np
import pytest

import pdvol
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from problems import block, ground, make_scene, make_stepper, weight
from shapes import together

G, DT, TOLERANCE = 9.81, 0.01, 1e-3
DAMPED = pdvol.NeoHookean(young=1e5, poisson=0.3, density=1000.0, damping=0.05)


def heap(steps):
    """Three damped blocks fall on each other, by 3, 6 and 9 cm, and come to rest within a second or two."""
    mesh = together(*(block((0.01 * i, 0.13 * i + 0.03), (0.2 + 0.01 * i, 0.13 * i + 0.13), 2) for i in range(3)))
    contact = (pdvol.Barrier(dhat=2e-3), pdvol.Friction(0.4, eps_v=1e-3))
    more = {"obstacles": ground(2)[:1], "loads": (weight(2),), "contact": contact}
    return make_scene((DAMPED,) * 3, dt=DT, steps=steps, solver=pdvol.Solver(tolerance=TOLERANCE), **more), mesh


def march(scene, mesh, name="implicit_euler", velocity=0.0):
    start = Start.at_rest(mesh.points, np.zeros_like(mesh.points) + velocity)
    return list(direct(make_stepper(scene, mesh, integrator=INTEGRATORS[name]()), start, scene.steps))


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_heap_that_has_come_to_rest_costs_an_iteration_a_step(name):
    """It lies still to the tolerance, and stays so."""
    scene, mesh = heap(300)
    reports = march(scene, mesh, name)
    iterations = np.array([report.newton_iterations for report in reports])
    assert iterations[-100:].mean() <= 2.0 < iterations[:50].mean()
    ways = np.abs(reports[-1].positions - reports[-101].positions)
    assert ways.max() <= 0.1 * TOLERANCE * DT * 100


def test_a_fall_over_tiny_steps_is_a_fall():
    """A step of 1e-5 s gains a tenth of the tolerance in speed: nothing is lost."""
    dt, steps = 1e-5, 400
    scene = make_scene(dt=dt, steps=steps, loads=(weight(2),), solver=pdvol.Solver(tolerance=TOLERANCE))
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    reports, time = march(scene, mesh), steps * dt
    fallen = mesh.points[:, 1] - reports[-1].positions[:, 1]
    np.testing.assert_allclose(fallen, 0.5 * G * time**2, atol=TOLERANCE * time)
    speed = (reports[-2].positions - reports[-1].positions)[:, 1] / dt
    np.testing.assert_allclose(speed, G * time, atol=TOLERANCE)
