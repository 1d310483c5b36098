"""Bodies that lie still: a step costs an iteration or two, no slow motion is lost, and what changes moves them."""

import numpy as np
import pytest

import pdvol
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from problems import block, make_scene, make_stepper
from shapes import grid, together

G, DT, TOLERANCE = 9.81, 0.01, 1e-3
DAMPED = pdvol.NeoHookean(young=1e5, poisson=0.3, density=1000.0, damping=0.05)
FLOOR = pdvol.Plane((0.0, 0.0), (0.0, 1.0))


def heap(steps, **more):
    """Three damped blocks fall on each other, by 3, 6 and 9 cm, and come to rest within a second or two."""
    mesh = together(*(block((0.01 * i, 0.13 * i + 0.03), (0.2 + 0.01 * i, 0.13 * i + 0.13), 2) for i in range(3)))
    more = {"obstacles": (FLOOR,), "loads": (pdvol.Gravity((0.0, -G)),)} | more
    contact = (pdvol.Barrier(dhat=2e-3), pdvol.Friction(0.4, eps_v=1e-3))
    return make_scene(
        (DAMPED,) * 3, dt=DT, steps=steps, contact=contact, solver=pdvol.Solver(tolerance=TOLERANCE), **more
    ), mesh


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
    scene = make_scene(dt=dt, steps=steps, loads=(pdvol.Gravity((0.0, -G)),), solver=pdvol.Solver(tolerance=TOLERANCE))
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    reports, time = march(scene, mesh), steps * dt
    fallen = mesh.points[:, 1] - reports[-1].positions[:, 1]
    np.testing.assert_allclose(fallen, 0.5 * G * time**2, atol=TOLERANCE * time)
    speed = (reports[-2].positions - reports[-1].positions)[:, 1] / dt
    np.testing.assert_allclose(speed, G * time, atol=TOLERANCE)


def test_what_is_scripted_moves_bodies_at_rest():
    """An impulse, a support that lets go, and a force that changes act in the step that they should act in."""
    dt, steps, at = 0.01, 40, 0.2
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    still = {"dt": dt, "steps": steps, "solver": pdvol.Solver(tolerance=TOLERANCE)}

    def heights(**physics):
        reports = march(make_scene(**still, **physics), mesh)
        return np.array([r.positions[:, 1].mean() for r in reports])

    y = heights(loads=(pdvol.Impulse((0.0, 1.0), time=at),))
    np.testing.assert_allclose(np.diff(y), np.where(np.arange(2, steps + 1) * dt > at + 1e-9, dt, 0.0), atol=1e-9)
    hold = pdvol.Support(lambda X: X[:, 1] > 0.09, release=at)
    y = heights(loads=(pdvol.Gravity((0.0, -G)),), supports=(hold,), obstacles=(), contact=())
    fall = np.diff(y)[21:] / dt
    np.testing.assert_allclose(np.diff(fall), -G * dt, atol=0.05 * G * dt)


def speeds(centre: np.ndarray) -> list[float]:
    """Mean speeds of two levels of a block that floats for one step, which is solved, before a wall comes."""
    levels = []
    for n in (2, 4):
        mesh = grid(np.linspace(0.0, 0.3, n + 1), np.linspace(0.0, 0.2, n + 1))
        levels.append(pdvol.Solid(mesh.points + centre, mesh.cells.astype(np.int32), mesh.regions))
    wall = pdvol.Plane(tuple(centre + [-0.01, 0.0]), (1.0, 0.0), pdvol.Translation((0.7, 0.0)))
    scene = pdvol.Scene(
        (pdvol.Body(tuple(levels), pdvol.NeoHookean(5e5, 0.3, 1000.0)),),
        obstacles=(wall,),
        contact=(pdvol.Barrier(),),
        dt=0.01,
        steps=3,
        solver=pdvol.Solver(tolerance=pdvol.Relative(1e-6)),
    )
    return [float(step.velocity[:, 0].mean()) for step in pdvol.march(scene)]


@pytest.mark.parametrize("place", [(1.0, 0.0), (1.04, -1.29), (7.7, -2.2)])
def test_a_step_without_motion_leads_the_finer_level_alike_anywhere(place):
    """Positions differ by round-off in it, or repeat to the last bit, as the place has it: level 1 goes alike."""
    there, here = speeds(np.array(place)), speeds(np.zeros(2))
    assert here[1] > 0.3 and here[-1] > 0.7
    assert there == pytest.approx(here, abs=1e-5)
