"""Default lengths follow the bodies: not their distance, and not the unit of length."""

from dataclasses import replace

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, Solver, Support, meshes
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.scene import Relative, metres

SIDE, STEPS = 0.2, 20
SOFT = NeoHookean(2e4, 0.4, 1000.0)
LENGTH = Relative(1e-3 * np.sqrt(3 / 5))  # of a cube: a thousandth of its own diagonal


def cube(name, at, scale=1.0, young=2e4):
    return Body(
        (meshes.brick((SIDE, SIDE, SIDE), (2, 2, 2)),),
        NeoHookean(young, 0.4, 1000.0),
        name=name,
        placement=Placement(translate=tuple(scale * np.array(at)), scale=scale),
        velocity=(0.5 * scale, 0.0, 0.0),
    )


def falling(*bodies, scale=1.0, supports=()):
    """Bodies that fall on a floor and slide on it."""
    return Scene(
        bodies,
        dt=0.01,
        integrator="implicit_euler",  # it damps what round-off adds
        steps=STEPS,
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),),
        loads=(Gravity((0.0, -9.81 * scale, 0.0)),),
        contact=(Barrier(LENGTH), Friction(0.3, eps_v=LENGTH)),
        solver=Solver(tolerance=LENGTH),
        supports=supports,
    )


def states(scene, points=slice(None)):
    level = pdvol.run(scene, progress=False).levels[0]
    return np.array([level.positions(step)[points] for step in range(STEPS + 1)])


NEAR = (0.0, 0.13, 0.0)


@pytest.fixture(scope="module")
def alone():
    return states(falling(cube("near", NEAR)))


def test_a_far_body_changes_no_state_by_more_than_the_tolerance(alone):
    scene = falling(cube("near", NEAR), cube("far", (100.0, 0.13, -3000.0)))
    count = alone.shape[1]
    both = states(scene, slice(count))
    diagonal = np.sqrt(5) * SIDE  # of the box around the sphere of radius sqrt(5 / 12) SIDE
    assert scene_diagonal(scene) == pytest.approx(diagonal)
    tolerance = metres(scene.solver.tolerance, diagonal) * scene.dt
    assert np.abs(both - alone).max() < tolerance
    # It has fallen, and lies nearer to the floor than a thousandth of its diagonal.
    assert 0.0 < both[-1, :, 1].min() < 1e-3 * diagonal < 0.01 < both[0, :, 1].min()


@pytest.mark.parametrize("scale", [2.0**-12, 2.0**14])
def test_scaled_scenes_move_alike(alone, scale):
    """Lengths, gravity and speeds times s, stiffness times s^2: the same motion, times s. Cubes of 0.05 mm and 3.3 km;
    even powers of two (and their roots) add little round-off that friction and contact could amplify.
    """
    scaled = states(falling(cube("near", NEAR, scale, 2e4 * scale**2), scale=scale))
    apart = np.abs(scaled / scale - alone).max(axis=(1, 2)) / (np.sqrt(5) * SIDE)
    assert (apart <= 3e-14 * np.arange(STEPS + 1)).all()  # round-off, as it adds up step by step


def test_the_diagonal_is_that_of_the_smallest_body_that_is_not_held():
    everywhere = lambda X: np.ones(len(X), dtype=bool)
    large, small = cube("large", NEAR, 3.0), cube("small", (5.0, 1.0, 0.0))
    diagonal = np.sqrt(5) * SIDE  # of the box around the sphere of radius sqrt(5 / 12) SIDE
    held = lambda **how: falling(large, small, supports=(Support(everywhere, body="small", **how),))
    assert scene_diagonal(falling(large)) == pytest.approx(3 * diagonal)
    assert scene_diagonal(falling(large, small)) == pytest.approx(diagonal)
    assert scene_diagonal(held()) == pytest.approx(3 * diagonal)
    assert scene_diagonal(held(release=0.1)) == pytest.approx(diagonal)
    assert scene_diagonal(falling(large, small, supports=(Support(everywhere),))) == pytest.approx(diagonal)
    sides = Support(lambda X: X[:, 0] < 5.0, body="small"), Support(lambda X: X[:, 0] >= 5.0, body="small")
    assert scene_diagonal(falling(large, small, supports=sides)) == pytest.approx(3 * diagonal)


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (1.0, 2.0, -0.5)])
def test_the_diagonal_does_not_change_where_the_world_is_turned(axis):
    turned = lambda body: replace(body, placement=replace(body.placement, axis=axis, angle=0.7))
    cubes, bar = cube("cube", NEAR), Body((meshes.brick((0.1, 0.02, 0.02), (4, 1, 1)),), SOFT, name="bar")
    for bodies in ((cubes,), (cubes, bar)):
        scene, other = falling(*bodies), falling(*map(turned, bodies))
        assert scene_diagonal(other) == pytest.approx(scene_diagonal(scene), rel=1e-12)


def test_the_diagonal_of_a_disc_and_a_ball_is_that_of_their_box():
    """And it does not depend on how finely they are drawn, nor on a facet that is turned round."""
    for shape in (meshes.disc(0.3), meshes.disc(0.3, 400)):
        assert scene_diagonal(falling(Body((shape,), SOFT))) == pytest.approx(np.sqrt(2) * 0.6, rel=1e-3)
    ball = meshes.ball(0.3)
    flipped = meshes.Surface(ball.vertices, np.vstack([ball.triangles[:1, ::-1], ball.triangles[1:]]))
    for shape in (ball, flipped):
        assert scene_diagonal(falling(Body((shape,), SOFT))) == pytest.approx(np.sqrt(3) * 0.6, rel=0.02)
