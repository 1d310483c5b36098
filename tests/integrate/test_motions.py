"""Scripted motions under contact: followed exactly where they can be, as far as possible where not, never through
anything.
"""

import numpy as np
import pytest

from pdvol.geometry.crossings import edges_of, find_crossings
from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.integrate.scripted_motion import LEAST_GAIN
from pdvol.scene import Barrier, Path, Plane, Rigid, Rotation, Sequential, Solver, Support, Translation
from problems import block, make_scene, make_stepper, march, polyline, weight

X = np.array([[1.0, 0.0, 2.0], [0.0, 1.0, -1.0]])
SOLVER = Solver(tolerance=1e-4)


def left(points):
    return points[:, 0] < 1e-9


def crosses(mesh, positions, obstacle) -> bool:
    """Whether the level's boundary crosses the obstacle (vertices, edges, faces), by the code that judges starts."""
    vertices, edges, faces = obstacle
    facets = np.concatenate([mesh.boundary, (edges if mesh.dim == 2 else faces) + len(positions)])
    points = np.concatenate([positions, vertices])
    solids = facets if mesh.dim == 3 else np.zeros((0, 3), dtype=int)
    groups = np.r_[np.zeros(len(positions), dtype=int), np.full(len(vertices), -1)]
    return len(find_crossings(points, edges_of(facets), solids, groups)) > 0


# ---- motions by themselves


@pytest.mark.parametrize("smooth", [False, True])
def test_a_path_passes_its_keyframes_and_rests_outside_them(smooth):
    path = Path((1.0, 2.0, 4.0), ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0, 3.0)), smooth)
    for t, shift in ((0.0, (0, 0, 0)), (1.0, (0, 0, 0)), (2.0, (1, 0, 0)), (4.0, (1, 2, 3)), (9.0, (1, 2, 3))):
        np.testing.assert_allclose(path(X, t) - X, np.tile(shift, (2, 1)), atol=1e-14)
    if not smooth:
        np.testing.assert_allclose(path(X, 3.0) - X, np.tile((1.0, 1.0, 1.5), (2, 1)))


def test_a_smooth_path_is_the_natural_spline():
    """Through 0, 1, 0 at t = 0, 1, 2: s(t) = 1.5 t - 0.5 t^3 up to t = 1, with s'' = 0 at t = 0 and s' = 0 at t = 1."""
    path = Path((0.0, 1.0, 2.0), ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0)), smooth=True)
    for t in (0.25, 0.5, 0.75):
        np.testing.assert_allclose(path(np.zeros((1, 2)), t), [[1.5 * t - 0.5 * t**3, 0.0]], atol=1e-14)


def test_sequential_turns_first_and_carries_what_has_turned():
    turn, walk = Rotation(np.pi / 2, (0.0, 0.0, 0.0)), Translation((0.0, 0.0, 5.0))
    np.testing.assert_allclose(Sequential((turn, walk))(X, 1.0), [[0.0, 1.0, 7.0], [-1.0, 0.0, 4.0]], atol=1e-14)
    clockwise = Rotation(np.pi / 2, (0.0, 0.0), axis=(0.0, 0.0, -1.0))
    np.testing.assert_allclose(clockwise(np.eye(2), 1.0), [[0.0, -1.0], [1.0, 0.0]], atol=1e-14)
    off = Sequential((walk, Rotation(np.pi, (0.0, 0.0, 5.0), (1.0, 0.0, 0.0))))
    np.testing.assert_allclose(off(X, 1.0), [[1.0, 0.0, 3.0], [0.0, -1.0, 6.0]], atol=1e-14)


def test_a_support_that_rests_elsewhere_gets_there_in_the_first_step():
    """And stays there when another one sets out, in the third step."""
    shift, late = np.array([-0.05, 0.02]), Path((0.2, 0.4), ((0.0, 0.0), (0.01, 0.0)))
    supports = Support(left, motion=lambda X, t: X + shift), Support(lambda X: X[:, 0] > 0.4 - 1e-9, motion=late)
    mesh = block((0.0, 0.0), (0.4, 0.1), (4, 1))
    for report in march(make_stepper(make_scene(dt=0.1, supports=supports), mesh), 4):
        np.testing.assert_allclose((report.positions - mesh.points)[left(mesh.points)], [shift] * 2, atol=1e-12)


# ---- release


@pytest.mark.parametrize("d", [2, 3])
def test_released_supports_fly_on(d):
    """All vertices are carried along at 2 m/s and let go at t = 0.03 s, within the second step: the third is the first
    free one.

    From then on it is free fall with the velocity of the motion: x = X + v t - g dt^2 k (k + 1) / 2 after k free steps.
    """
    v = 2.0 * np.eye(d)[0]
    held = Support(lambda X: X[:, 0] > -1.0, motion=Translation(tuple(v)), release=0.03)
    scene = make_scene(dt=0.02, loads=(weight(d),), supports=(held,))
    mesh = block((0.0,) * d, (0.2,) * d, 1)
    for report in march(make_stepper(scene, mesh), 6):
        free = max(0, report.step - 2)
        fall = -9.81 * scene.dt**2 * free * (free + 1) / 2 * np.eye(d)[-1]
        np.testing.assert_allclose(report.positions, mesh.points + v * report.time + fall, atol=1e-9)
        assert report.reached == 1.0


def test_releasing_part_frees_only_that_part():
    """Both ends held; one is let go of at a step's very beginning, to round-off, and moves in that step."""
    right = lambda X: X[:, 0] > 0.4 - 1e-9
    scene = make_scene(dt=0.1, loads=(weight(2),), supports=(Support(left), Support(right, release=0.1 + 0.2)))
    mesh = block((0.0, 0.0), (0.4, 0.1), (4, 1))
    problem = make_stepper(scene, mesh)
    moves = [np.abs((report.positions - mesh.points)[right(mesh.points)]).max() for report in march(problem, 4)]
    assert moves[:3] == [0.0, 0.0, 0.0] and moves[3] > 1e-3
    one, *_ = march(make_stepper(scene, mesh), 1, first=4)  # set out in the middle, as a resumed run does
    assert np.abs((one.positions - mesh.points)[right(mesh.points)]).max() > 1e-3


# ---- through contact


@pytest.mark.parametrize(("d", "speed"), [(2, 1.0), (3, 10.0)])
def test_a_support_driven_through_a_wall_stops_in_front_of_it(d, speed):
    """A support presses a block against a wall and wants to go on through it; it ends just in front of it, and waits
    there.

    The wall is 0.35 m away. The motion waits where a part of it would gain less than `LEAST_GAIN` of a step's way.
    """
    dhat, wall, e = 5e-3, 0.35, np.eye(d)[0]
    scene = make_scene(
        dt=0.02,
        supports=(Support(left, motion=Translation(tuple(speed * e))),),
        obstacles=(Plane(tuple(wall * e), tuple(-e)),),
        contact=(Barrier(dhat=dhat),),
        solver=SOLVER,
    )
    mesh = block((0.0,) * d, (0.3,) + (0.2,) * (d - 1), (4,) + (2,) * (d - 1) if d == 2 else (2, 1, 1))
    stop = wall / speed
    for report in march(make_stepper(scene, mesh), int(np.ceil(stop / scene.dt)) + 2):
        x = report.positions
        assert x[:, 0].max() < wall and simplex_volumes(x, mesh.cells).min() > 0.0
        held = x[left(mesh.points), 0]
        np.testing.assert_allclose(held, speed * (report.time - report.behind), atol=1e-12)
        assert (report.reached == 1.0) == (report.behind == 0.0) == (report.time < stop)
    assert 0.0 < wall - held[0] < 3.0 * LEAST_GAIN * speed * scene.dt
    assert report.remedies["halvings"] == 0
    assert report.reached < 1e-3  # it waits: gaps do not shrink step by step for nothing
    assert report.min_gap > 1e-10
    assert report.friction_residual is None and report.friction_iterations == 0


def test_a_body_pressed_to_a_wall_turns_with_it():
    """By 0.5 rad a step, its support and the wall about one centre: nothing is in the way, and gaps are
    hundredths of dhat.

    Straight ways leave the wall by the arc's height over its chord, hundreds of gaps, unless they are found for places
    near enough.
    """
    speed, dt, press, inner = 25.0, 0.02, np.array([0.03, 0.0]), 0.05 - 1e-4

    def turn(X, t):
        c, s = np.cos(speed * max(t - dt, 0.0)), np.sin(speed * max(t - dt, 0.0))
        return X @ np.array([[c, s], [-s, c]])

    support = Support(lambda X: X[:, 0] > 0.3 - 1e-9, motion=lambda X, t: turn(X - min(t / dt, 1.0) * press, t))
    wall = polyline([(0.02, -0.05), (inner, -0.05), (inner, 0.15), (0.02, 0.15)])
    scene = make_scene(
        dt=dt,
        supports=(support,),
        obstacles=(Rigid("wall", motion=turn),),
        contact=(Barrier(dhat=2e-3, stiffness=1e-3),),
        solver=SOLVER,
    )
    for report in march(make_stepper(scene, block((0.05, 0.0), (0.3, 0.1), (5, 2)), [wall]), 4):
        assert report.reached == 1.0 and report.behind == 0.0
        assert 1e-6 < report.min_gap < 2e-5


@pytest.mark.parametrize(("d", "speed"), [(2, 5.0), (3, 50.0)])
def test_a_plane_carries_a_free_block_along(d, speed):
    """At 0.1 m and 1 m a step, up to three times the block's length and 200 dhat: all of it is carried out."""
    dhat, e = 5e-3, np.eye(d)[0]
    plane = Plane(tuple(-0.05 * e), tuple(e), Translation(tuple(speed * e)))
    scene = make_scene(dt=0.02, obstacles=(plane,), contact=(Barrier(dhat=dhat),), solver=SOLVER)
    mesh = block((0.0,) * d, (0.3,) + (0.2,) * (d - 1), (2,) + (1,) * (d - 1))
    for report in march(make_stepper(scene, mesh), 3):
        assert report.reached == 1.0 and report.behind == 0.0
        assert report.positions[:, 0].min() > speed * report.time - 0.05
    assert sum(report.remedies.values()) == 0, "the last step is free flight"
