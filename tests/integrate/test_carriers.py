"""Obstacles that move carry the free bodies that they meet, and so keep their time.

Where a body is pressed against something that does not go along, nothing is carried.
"""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.scripted_motion import carriers
from pdvol.levels.obstacles import plane_obstacle
from pdvol.meshing.build import read_obstacle
from pdvol.scene import Barrier, Friction, Placement, Plane, Rigid, Rotation, Solver, Support, Translation
from problems import block, make_scene, make_stepper, masses, tetrahedron
from shapes import together

RADIUS, GAP = 0.15, 0.02


def ball_and_cubes(d, speed, bodies=1, resolution=4, **more):
    """A rigid ball on its way to a row of cubes of 0.3 m, 1e5 Pa, 1 cm apart, by steps of 0.01 s."""
    e = np.eye(d)[0]
    shape = meshes.ball(RADIUS, 2) if d == 3 else meshes.disc(RADIUS)
    start = Placement(translate=tuple(-(RADIUS + GAP) * e))
    ball = Rigid(shape, name="ball", placement=start, motion=Translation(tuple(speed * e)))
    cubes = [
        block((0.31 * i,) + (-0.15,) * (d - 1), (0.31 * i + 0.3,) + (0.15,) * (d - 1), resolution)
        for i in range(bodies)
    ]
    materials = make_scene().bodies[0].material
    more = {"contact": (Barrier(dhat=2e-3),)} | more
    obstacles = (ball, *more.pop("obstacles", ()))
    scene = make_scene((materials,) * bodies, dt=0.01, obstacles=obstacles, solver=Solver(tolerance=1e-3), **more)
    return scene, together(*cubes), [read_obstacle(ball)]


def march(scene, mesh, geometry, steps):
    """Reports, and each step's mean velocities (bodies, d) [m/s]."""
    problem = make_stepper(scene, mesh, geometry)
    m, x, reports, speeds = masses(problem), mesh.points, [], []
    bodies = [mesh.point_bodies == b for b in range(int(mesh.point_bodies.max()) + 1)]
    for report in direct(problem, Start.at_rest(x, 0.0 * x), steps):
        assert simplex_volumes(report.positions, mesh.cells).min() > 0.0
        assert report.min_gap is None or report.min_gap > 0.0
        v, x = (report.positions - x) / scene.dt, report.positions
        reports.append(report)
        speeds.append([np.average(v[body], axis=0, weights=m[body]) for body in bodies])
    return reports, np.array(speeds)


@pytest.mark.parametrize(("d", "speed"), [(2, 15.0), (3, 50.0)])
def test_a_ball_drives_a_free_cube_before_it_and_keeps_its_time(d, speed):
    """The cube leaves faster than the ball, which at 50 m/s moves by more than the cube's size in a step, at thrice the
    speed of sound.
    """
    reports, speeds = march(*ball_and_cubes(d, speed), 8)
    assert all(report.reached == 1.0 and report.behind == 0.0 and report.cuts == 0 for report in reports)
    assert max(report.newton_iterations for report in reports) <= 80
    assert speeds[-1, 0, 0] > speed


def test_a_row_of_cubes_is_pushed_until_a_wall_holds_it():
    """The first cube carries the second. Once that is at the wall, both are pressed, and the ball waits."""
    scene, mesh, geometry = ball_and_cubes(
        2, 15.0, bodies=2, obstacles=(Plane((0.8, 0.0), (-1.0, 0.0)),), contact=(Barrier(dhat=2e-3), Friction(0.5))
    )
    reports, speeds = march(scene, mesh, geometry, 12)
    reached = [report.reached for report in reports]
    assert reached[:2] == [1.0, 1.0] and not any(report.remedies["substeps"] for report in reports[:2])
    assert speeds[1, 0, 0] > 5.0, "the first cube goes with the ball"
    assert reached[-1] < 0.1 and reports[-1].behind > 0.02
    assert reports[-1].positions[:, 0].max() < 0.8
    places = RADIUS + GAP - 15.0 * (reports[-1].time - reports[-1].behind)
    assert -places < 0.8 - 0.05, "nothing is squeezed to nothing"


def test_a_paddle_carries_a_free_cube_round():
    """By 0.3 rad a step: the cube goes along a chord of the arc, as the paddle does."""
    speed = 30.0
    geometry = tetrahedron([(0.0, -0.3, -0.02), (1.5, -0.3, 0.01), (0.0, -0.35, 0.0), (0.0, -0.3, 0.1)])
    paddle = Rigid("paddle", motion=Rotation(speed, (0.0, -0.3, 0.0), (0.0, 0.0, 1.0)))
    mesh = block((0.5, -0.15, -0.15), (0.8, 0.15, 0.15), 3)
    scene = make_scene(dt=0.01, obstacles=(paddle,), contact=(Barrier(dhat=2e-3),), solver=Solver(tolerance=1e-3))
    reports, speeds = march(scene, mesh, [geometry], 8)
    assert all(report.reached == 1.0 and report.remedies["substeps"] == 0 for report in reports)
    assert np.linalg.norm(speeds[-1, 0]) > 0.5 * speed


def test_what_supports_hold_is_not_carried():
    """A held cube makes the ball wait, though a free one behind it would go along."""
    scene, mesh, geometry = ball_and_cubes(2, 15.0, bodies=2, supports=(Support(lambda X: X[:, 0] < 0.29, "body 0"),))
    reports, speeds = march(scene, mesh, geometry, 3)
    assert reports[-1].behind > 0.0 and abs(speeds[-1, 1, 0]) < 0.1


# ---- who carries whom

STILL, PUSH, OTHER = (
    plane_obstacle(Plane((0.0, 0.0), (0.0, 1.0), motion, name=name))
    for name, motion in (("still", Plane((0, 0), (0, 1)).motion), *((n, Translation((1.0, 0.0))) for n in "ab"))
)


def carried(pairs, held=()):
    """Who carries whom where these pairs meet whenever exactly one of them goes along, or both with different ones."""
    by = lambda thing, of: thing if not isinstance(thing, int) and thing.moves else of.get(thing)
    return carriers(frozenset(held), lambda of: [pair for pair in pairs if by(pair[0], of) is not by(pair[1], of)])


@pytest.mark.parametrize(
    ("pairs", "held", "of", "blocked"),
    [
        ([(0, PUSH), (1, 0), (1, 2), (3, STILL)], (), {0: PUSH, 1: PUSH, 2: PUSH}, False),  # each carries the next
        ([(0, PUSH), (0, 1), (1, STILL), (2, OTHER)], (), {2: OTHER}, True),  # a row that ends at a wall
        ([(0, PUSH), (0, 1)], (1,), {}, True),  # a row that ends at a held body
        ([(0, PUSH), (0, OTHER)], (), {}, True),  # between two that move differently
        ([], (), {}, False),  # nothing meets
    ],
)
def test_who_is_carried(pairs, held, of, blocked):
    assert carried(pairs, held) == (of, blocked)
