"""Deforming obstacles: friction takes the velocity of the point that it acts on, and nothing crosses what changes its
shape.
"""

import numpy as np
import pytest
from test_motions import crosses

from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.levels.obstacles import read_geometry
from pdvol.scene import Barrier, Deforming, Friction, NeoHookean, PointCache, Rigid, Rotation, Solver, Support
from problems import block, make_scene, make_stepper, march, masses, polyline, tetrahedron, weight

G, MU, DHAT = 9.81, 0.5, 2e-3
STIFF = NeoHookean(young=1e6, poisson=0.3, density=1000.0)


def belt(d, speed, time=1.0, n=8):
    """The cache of a belt whose upper run goes to the right and whose lower run to the left, at `speed` [m/s]: no rigid
    motion goes with it. Its top is at height zero.
    """
    x = np.linspace(-2.0, 2.0, n + 1)
    loop = np.concatenate([np.column_stack([x[::-1], 0.0 * x]), np.column_stack([x, 0.0 * x - 0.5])])
    way = np.where(loop[:, 1] > -0.25, 1.0, -1.0)[:, None] * [speed * time, 0.0]
    count = len(loop)
    edges = np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])
    if d == 3:
        sides = [np.insert(loop, 1, y, axis=1) for y in (-1.0, 1.0)]
        loop, way = np.concatenate(sides), np.tile(np.insert(way, 1, 0.0, axis=1), (2, 1))
        a, b = edges.T
        edges = np.concatenate([np.column_stack([a, b, b + count]), np.column_stack([a, b + count, a + count])])
    return PointCache(np.array([loop, loop + way]), times=(0.0, time), faces=edges)


def bulge(d, height, time, n=8):
    """The cache of a sheet at height zero whose middle rises to `height` [m] within `time` [s]."""
    ticks = [np.linspace(-0.5, 0.5, n + 1)] * (d - 1)
    flat = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, d - 1)
    up = height * np.prod(np.cos(np.pi * flat), axis=1)
    rest = np.column_stack([flat, 0.0 * up])
    if d == 2:
        faces = np.column_stack([np.arange(n), np.arange(1, n + 1)])
    else:
        a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
        faces = np.concatenate([np.column_stack([a, a + n + 1, a + n + 2]), np.column_stack([a, a + n + 2, a + 1])])
    return PointCache(np.array([rest, rest + up[:, None] * np.eye(d)[-1]]), times=(0.0, time), faces=faces)


@pytest.mark.parametrize("d", [2, 3])
def test_a_block_on_a_belt_slides_and_then_goes_along_with_it(d):
    """The belt starts at 0.2 m/s. Friction accelerates the block by mu g until it has the belt's speed, after 0.041 s;
    it keeps that, to the speed below which friction is smoothed. The belt as a whole does not move.
    """
    scene = make_scene(
        (STIFF,),
        dt=0.01,
        loads=(weight(d),),
        obstacles=(Deforming(belt(d, 0.2), name="belt", closed=d == 2),),
        contact=(Barrier(dhat=DHAT), Friction(MU, eps_v=1e-4, iterations=3)),
        solver=Solver(tolerance=1e-7, linear="direct"),
    )
    mesh = block((0.0,) * (d - 1) + (0.88 * DHAT,), (0.2,) * (d - 1) + (0.1,), (4,) * (d - 1) + (2,))
    problem = make_stepper(scene, mesh, read_geometry(scene.obstacles))
    weights = masses(problem) / masses(problem).sum()
    speeds = np.array([weights @ report.velocity for report in march(problem, 20)])
    np.testing.assert_allclose(speeds[2:4, 0], 0.01 * MU * G * np.array([3, 4]), rtol=5e-3)
    np.testing.assert_allclose(speeds[-5:, 0], 0.2, atol=1e-4)
    assert np.abs(speeds[-5:, 1:]).max() < 5e-3


def paddle(d, speed):
    """A bar that turns about its left end into a block held at its bottom; and the obstacle's geometry."""
    if d == 2:
        geometry = polyline([(-0.05, 0.2), (0.45, 0.2), (0.45, 0.25), (-0.05, 0.25)])
    else:
        geometry = tetrahedron([(-0.05, 0.03, 0.2), (0.45, 0.05, 0.2), (0.45, -0.02, 0.3), (0.2, 0.1, 0.3)])
    centre = -0.05 * np.eye(d)[0] + 0.22 * np.eye(d)[-1]
    motion = Rotation(-speed if d == 2 else speed, tuple(centre), (0.0, 0.0, 1.0) if d == 2 else (0.0, 1.0, 0.0))
    return Rigid("paddle", motion=motion), geometry


@pytest.mark.parametrize(("d", "kind", "steps"), [(2, 50.0, 2), (3, 5.0, 6), (2, "sheet", 3), (3, "sheet", 3)])
def test_what_contact_holds_back_is_where_it_says_and_crosses_nothing(d, kind, steps):
    """A paddle turns by up to 1 rad a step into a block that is held at its bottom: the chord of its arc cuts through
    the block, but the arc itself does not. Or the middle of a sheet wants to rise by 0.3 m within two steps, below a
    block whose top is held 0.1 m above it.
    """
    if kind == "sheet":
        obstacle = Deforming(bulge(d, 0.3, 0.04), name="sheet", closed=False)
        (shape,) = read_geometry((obstacle,))
        low, high, n = (-0.15,) * (d - 1) + (0.1,), (0.15,) * (d - 1) + (0.2,), (4, 2) if d == 2 else (2, 2, 1)
        held = lambda X: X[:, -1] > 0.2 - 1e-9
    else:
        obstacle, shape = paddle(d, kind)
        low, high, n = (0.1,) + (0.0,) * (d - 1), (0.5,) + (0.1,) * (d - 1), (4, 1) if d == 2 else (3, 1, 1)
        held = lambda X: X[:, -1] < 1e-9
    more = {"contact": (Barrier(dhat=5e-3),), "solver": Solver(tolerance=1e-4)}
    mesh = block(low, high, n)
    problem = make_stepper(make_scene(dt=0.02, supports=(Support(held),), obstacles=(obstacle,), **more), mesh, [shape])
    (found,), behind, touched = problem.model.obstacles, 0.0, False
    for report in march(problem, steps):
        at = found.at(report.time - report.behind)
        np.testing.assert_allclose(problem.potential.contacts[-1].surface.obstacle_positions, at, atol=1e-14)
        assert not crosses(mesh, report.positions, (at, *shape[1:]))
        assert simplex_volumes(report.positions, mesh.cells).min() > 0.0
        assert report.reached == pytest.approx(1.0 - report.behind / (0.02 + behind), abs=1e-12)
        behind, touched = report.behind, touched or report.contacts > 0
    assert touched and behind > 0.0
    # Where it should be by now it would stand in the block.
    later = report.time - 0.8 * behind if kind == "sheet" else 0.1 if kind == 5.0 else 0.012
    assert crosses(mesh, report.positions, (found.at(later), *shape[1:]))
    assert kind != "sheet" or at[:, -1].max() > 0.1, "the sheet has dented the block"


@pytest.mark.parametrize("d", [2, 3])
def test_a_free_block_is_thrown_up_by_a_sheet_and_never_crosses_it(d):
    """The sheet bulges by 0.2 m within one step, twice the block's height."""
    scene = make_scene(
        dt=0.02,
        obstacles=(Deforming(bulge(d, 0.2, 0.02), name="sheet", closed=False),),
        contact=(Barrier(dhat=5e-3), Friction(0.3)),
        solver=Solver(tolerance=1e-5, linear="direct"),
    )
    mesh = block((-0.1,) * (d - 1) + (0.01,), (0.12,) * (d - 1) + (0.11,), (4, 2) if d == 2 else (2, 2, 1))
    shapes = read_geometry(scene.obstacles)
    problem = make_stepper(scene, mesh, shapes)
    (obstacle,) = problem.model.obstacles
    for report in march(problem, 3):
        assert not crosses(mesh, report.positions, (obstacle.at(report.time - report.behind), *shapes[0][1:]))
        assert simplex_volumes(report.positions, mesh.cells).min() > 0.0
    assert report.behind == 0.0 and report.positions[:, -1].mean() > 0.25
