"""Bodies at rest: gap and pressure converge as the mesh is refined; steps cost little, and no slow motion is lost."""

import numpy as np
import pytest
from scipy.optimize import brentq

import barrier_law
from pdvol.geometry.level_mesh import boundary_areas
from pdvol.integrate.marches import Start, direct
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Friction, NeoHookean, Solver
from problems import block, ground, make_scene, make_stepper, march, weight
from shapes import together

G, DHAT, SIDE = 9.81, 2e-3, 0.2
DT, TOLERANCE = 0.01, 1e-3
SOFT = NeoHookean(young=1e5, poisson=0.3, density=1000.0)
WEIGHT = SOFT.density * G * SIDE  # [Pa]


def rest(d, n):
    """A cube of n cells a side after it came to rest on a plane, from 0.9 dhat above: gaps [m] and areas of its
    lower side's vertices.
    """
    scene = make_scene(
        (SOFT,),
        dt=0.02,
        loads=(weight(d),),
        obstacles=ground(d)[:1],
        contact=(Barrier(dhat=DHAT),),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    lift = 0.9 * DHAT
    mesh = block((0.0,) * (d - 1) + (lift,), (SIDE,) * (d - 1) + (SIDE + lift,), n)
    reports = list(march(make_stepper(scene, mesh), 40))
    x = reports[-1].positions
    assert np.abs(reports[-1].velocity).max() < 1e-3
    low = mesh.points[:, -1] < lift + 1e-9
    facets = mesh.boundary[low[mesh.boundary].all(axis=1)]  # corners' sides do not press
    assert boundary_areas(mesh)[low].min() > 0.0
    areas = np.bincount(facets.ravel(), minlength=len(low))[low] * SIDE ** (d - 1) / facets.size
    return x[low, -1], areas


def pressures(gaps):
    return barrier_law.pressure((gaps / DHAT) ** 2, DHAT, Barrier().stiffness * SOFT.young)


@pytest.mark.parametrize(("d", "sizes"), [(2, (2, 4, 8, 16)), (3, (1, 2, 4))])
def test_gap_and_pressure_converge(d, sizes):
    """The pressure below a resting block is its weight over its area, rho g h (uniaxial stress is exact), and the gap
    the barrier's at it.

    A vertex at the lower rim carries half of its area on the sides, too, so that the rim presses more: an error of
    first order in the mesh.
    """
    expected = DHAT * brentq(lambda y: pressures(y * DHAT) - WEIGHT, 1e-3, 1.0 - 1e-9)
    gap_errors, pressure_errors = [], []
    for n in sizes:
        gaps, areas = rest(d, n)
        gap_errors.append(abs(np.average(gaps, weights=areas) - expected) / DHAT)
        pressure_errors.append(abs(np.average(pressures(gaps), weights=areas) / WEIGHT - 1.0))
    for errors in (gap_errors, pressure_errors):
        assert np.all(np.diff(errors) < 0.0), errors
        assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] < -0.7, errors
    assert gap_errors[-1] < (0.01 if d == 2 else 0.02) and pressure_errors[-1] < (0.1 if d == 2 else 0.4), (
        gap_errors,
        pressure_errors,
    )


# ---- bodies that lie still: a step costs an iteration or two, and no slow motion is lost


def heap(steps):
    """Three damped blocks fall on each other, by 3, 6 and 9 cm, and come to rest within a second or two."""
    mesh = together(*(block((0.01 * i, 0.13 * i + 0.03), (0.2 + 0.01 * i, 0.13 * i + 0.13), 2) for i in range(3)))
    contact = (Barrier(dhat=2e-3), Friction(0.4, eps_v=1e-3))
    more = {"obstacles": ground(2)[:1], "loads": (weight(2),), "contact": contact, "solver": Solver(TOLERANCE)}
    return make_scene((NeoHookean(1e5, 0.3, 1000.0, damping=0.05),) * 3, dt=DT, steps=steps, **more), mesh


def marched(scene, mesh, name="implicit_euler", velocity=0.0):
    start = Start.at_rest(mesh.points, np.zeros_like(mesh.points) + velocity)
    return list(direct(make_stepper(scene, mesh, integrator=INTEGRATORS[name]()), start, scene.steps))


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_heap_that_has_come_to_rest_costs_an_iteration_a_step(name):
    """It lies still to the tolerance, and stays so."""
    scene, mesh = heap(300)
    reports = marched(scene, mesh, name)
    iterations = np.array([report.newton_iterations for report in reports])
    assert iterations[-100:].mean() <= 2.0 < iterations[:50].mean()
    assert np.abs(reports[-1].positions - reports[-101].positions).max() <= 0.1 * TOLERANCE * DT * 100


def test_a_fall_over_tiny_steps_is_a_fall():
    """A step of 1e-5 s gains a tenth of the tolerance in speed: nothing is lost."""
    dt, steps = 1e-5, 400
    scene = make_scene(dt=dt, steps=steps, loads=(weight(2),), solver=Solver(tolerance=TOLERANCE))
    mesh = block((0.0, 0.0), (0.1, 0.1), 1)
    reports, time = marched(scene, mesh), steps * dt
    fallen = mesh.points[:, 1] - reports[-1].positions[:, 1]
    np.testing.assert_allclose(fallen, 0.5 * G * time**2, atol=TOLERANCE * time)
    speed = (reports[-2].positions - reports[-1].positions)[:, 1] / dt
    np.testing.assert_allclose(speed, G * time, atol=TOLERANCE)
