"""Friction, drag and material damping have the order of the integrator; what sticks stays; contact does not ring."""

from functools import cache

import numpy as np
import pytest

from pdvol.integrate.marches import Start, direct
from pdvol.potentials.potential import Positions
from pdvol.registry import INTEGRATORS
from pdvol.scene import Barrier, Flow, Friction, NeoHookean, Path, Solver
from problems import block, ground, make_scene, make_stepper, masses, weight
from shapes import level

G = 9.81
ORDERS = {"implicit_euler": (0.85, 1.15), "bdf2": (1.8, 2.2)}


def slope(lengths, errors):
    return np.polyfit(np.log(lengths), np.log(errors), 1)[0]


@cache
def settled(shape, young, dhat, gap, length):
    """Positions (n, d) in which a body of a shape, a function, lies on a plane `gap` below it, for good."""
    mesh = shape()
    scene = make_scene(
        (NeoHookean(young, 0.3, 1000.0, damping=0.2),),
        dt=0.05,
        steps=length,
        loads=(weight(2),),
        obstacles=ground(2, height=mesh.points[:, 1].min() - gap)[:1],
        contact=(Barrier(dhat=dhat),),
        solver=Solver(tolerance=1e-9, linear="direct"),
    )
    *_, last = direct(make_stepper(scene, mesh), Start.at_rest(mesh.points, 0.0 * mesh.points), length)
    assert np.abs(last.velocity).max() < 1e-7
    return last.positions


def slab():
    return block((0.0, 0.0), (0.3, 0.2), 2)


@pytest.mark.parametrize("name", INTEGRATORS)
def test_a_slide_in_the_wind_has_the_order_of_the_integrator(name):
    """A block with material damping slides in a flow, with friction in its smoothed range, whose normal forces are
    lagged until they are right. Errors are differences from twice as many steps.
    """
    mesh = slab()
    lies = settled(slab, 2e4, 0.02, 0.015, 120)
    ends, counts = [], (10, 20, 40)
    for steps in counts:
        scene = make_scene(
            (NeoHookean(2e4, 0.3, 1000.0, damping=0.02),),
            dt=0.1 / steps,
            steps=steps,
            loads=(weight(2), Flow((1.0, 0.0), 200.0)),
            obstacles=ground(2, height=-0.015)[:1],
            contact=(Barrier(dhat=0.02), Friction(0.3, eps_v=1.0, iterations=50, tolerance=1e-9)),
            solver=Solver(tolerance=1e-10, linear="direct"),
        )
        stepper = make_stepper(scene, mesh, integrator=INTEGRATORS[name]())
        *_, last = direct(stepper, Start.at_rest(lies, np.tile([0.4, 0.0], (len(lies), 1))), steps)
        ends.append(last.positions)
    errors = [np.linalg.norm(one - other) for one, other in zip(ends, ends[1:], strict=False)]
    low, high = ORDERS[name]
    assert low < slope(1.0 / np.array(counts[:-1]), errors) < high


@pytest.mark.parametrize(("kind", "name"), [("plane", "bdf2"), ("rigid", "bdf2"), ("rigid", "implicit_euler")])
def test_what_sticks_to_shaken_ground_stays_there(kind, name):
    """The ground goes 5 cm back and forth with a fifth of the acceleration that friction can hold. A body that sticks
    only creeps, as slowly as the smoothing says.
    """
    eps_v, steps, dt = 1e-3, 40, 0.02
    times = np.linspace(0.0, 0.8, 9)
    keys = [(0.025 * (1.0 - np.cos(2.0 * np.pi * t / 0.8)), 0.0) for t in times]
    motion = Path(tuple(times), keys, smooth=True)
    mesh, (floor, geometry) = block((0.0, 0.0), (0.3, 0.1), (3, 1)), ground(2, kind, -0.0018, motion)
    scene = make_scene(
        (NeoHookean(1e6, 0.3, 1000.0, damping=0.05),),
        dt=dt,
        steps=steps,
        loads=(weight(2),),
        obstacles=(floor,),
        contact=(Barrier(dhat=2e-3), Friction(0.8, eps_v=eps_v)),
        solver=Solver(tolerance=1e-7, linear="direct"),
    )
    stepper = make_stepper(scene, mesh, geometry, integrator=INTEGRATORS[name]())
    start, away = Start.at_rest(mesh.points, 0.0 * mesh.points), []
    for report in direct(stepper, start, steps):
        shifts = (report.positions - mesh.points)[:, 0] - motion(np.zeros((1, 2)), report.time)[0, 0]
        away.append(shifts.mean())
    fraction = 0.025 * (2.0 * np.pi / 0.8) ** 2 / (0.8 * G)
    most = (1.0 - np.sqrt(1.0 - fraction)) * eps_v * 0.4  # 2 y - y^2 is the fraction at y eps_v, for half of the time
    assert 0.1 * most < np.abs(away).max() < most
    assert abs(away[-1]) < 0.25 * most, "what creeps one way creeps back"


RADIUS = 0.25


def disc(rings=3, around=24):
    """A polygon around the origin."""
    angles = 2.0 * np.pi * np.arange(around) / around
    circle = RADIUS * np.column_stack([np.cos(angles), np.sin(angles)])
    points = np.vstack([[[0.0, 0.0]], *(circle * (k + 1) / rings for k in range(rings))])
    at = lambda k, j: 1 + k * around + j % around
    cells = [(0, at(0, j), at(0, j + 1)) for j in range(around)]
    for k, j in np.ndindex(rings - 1, around):
        cells += [(at(k, j), at(k + 1, j), at(k + 1, j + 1)), (at(k, j), at(k + 1, j + 1), at(k, j + 1))]
    return level(points, np.array(cells))


@pytest.mark.parametrize(
    ("motion", "name", "kept"),
    [("kick", "implicit_euler", (0.0, 0.1)), ("kick", "bdf2", (0.6, 1.0)), ("roll", "bdf2", (0.94, 1.0))],
)
def test_a_ball_that_touches_the_ground_does_not_ring(motion, name, kept):
    """A soft ball that lies on the ground is kicked down by 2 cm/s, or rolls with 1 m/s, for 0.6 s. Its material damps
    nothing. Its energy never rises above that of the kick, and BDF2 keeps most of it. Gaps go up and down with the
    ball's swing or its facets, over several steps; they would turn round in each step if contact rang.
    """
    mesh, dt, steps = disc(), 0.01, 60
    lies = settled(disc, 1e5, 2e-3, 1.5e-3, 200)
    scene = make_scene(
        (NeoHookean(1e5, 0.3, 1000.0),),
        dt=dt,
        steps=steps,
        loads=(weight(2),),
        obstacles=ground(2, height=-RADIUS - 1.5e-3)[:1],
        contact=(Barrier(dhat=2e-3), Friction(0.5, eps_v=1e-3)),
        solver=Solver(tolerance=1e-6, linear="direct"),
    )
    stepper = make_stepper(scene, mesh, integrator=INTEGRATORS[name]())
    m = masses(stepper)
    arms = lies - m @ lies / m.sum()
    velocity = np.tile([0.0, -0.02], (len(m), 1))
    if motion == "roll":
        velocity = np.column_stack([1.0 + arms[:, 1] / RADIUS, -arms[:, 0] / RADIUS])
    at_rest = Positions(stepper.space, stepper.space.from_input(lies))
    stepper.potential.begin_step(at_rest, at_rest.owned, dt**2, 0.0, dt)
    stored = lambda energy: sum(energy[kind] for kind in ("elastic", "load", "barrier"))
    lowest, kinetic = stored(stepper.potential.energies(at_rest)), lambda v: 0.5 * m @ np.sum(v**2, axis=1)
    gaps, energies = [], [kinetic(velocity)]
    for report in direct(stepper, Start.at_rest(lies, velocity), steps):
        gaps.append(report.min_gap)
        energies.append(kinetic(report.velocity) + stored(report.energy) - lowest)
    assert kept[0] < energies[-1] / energies[0] < kept[1]
    assert max(energies) <= energies[0] and np.diff(energies).max() < 1e-3 * energies[0]
    turns = np.diff(gaps)[1:] * np.diff(gaps)[:-1] < -((1e-3 * np.mean(gaps)) ** 2)
    assert not (turns[2:] & turns[1:-1] & turns[:-2]).any(), "the gap turns round in four steps, one after the other"
    assert 0.98 < min(gaps) / np.mean(gaps) and max(gaps) / np.mean(gaps) < 1.02
