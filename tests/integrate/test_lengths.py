"""Default lengths follow the bodies: not their distance, and not the unit of length."""

import numpy as np
import pytest

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, Support, meshes
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.scene import Relative, metres

SIDE, STEPS = 0.2, 30


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
        steps=STEPS,
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),),
        loads=(Gravity((0.0, -9.81 * scale, 0.0)),),
        contact=(Barrier(), Friction(0.3)),
        supports=supports,
    )


def states(scene, points=slice(None)):
    level = pdvol.run(scene, progress=False).levels[0]
    return np.array([level.positions(step)[points] for step in range(STEPS + 1)])


NEAR = (0.0, 0.13, 0.0)


@pytest.fixture(scope="module")
def alone():
    return states(falling(cube("near", NEAR)))


@pytest.mark.parametrize("far", [(100.0, 0.13, 0.0), (0.0, 3000.0, -3000.0)])
def test_a_far_body_changes_no_state_by_more_than_the_tolerance(alone, far):
    scene = falling(cube("near", NEAR), cube("far", far))
    count = alone.shape[1]
    both = states(scene, slice(count))
    diagonal = np.sqrt(3) * SIDE
    assert scene_diagonal(scene) == pytest.approx(diagonal)
    tolerance = metres(scene.solver.tolerance, diagonal) * scene.dt
    assert np.abs(both - alone).max() < tolerance
    # It has fallen, and lies nearer to the floor than a thousandth of its diagonal.
    assert 0.0 < both[-1, :, 1].min() < 1e-3 * diagonal < 0.01 < both[0, :, 1].min()


@pytest.mark.parametrize("scale", [2.0**-12, 2.0**14])
def test_scaled_scenes_move_alike(alone, scale):
    """Lengths, gravity and speeds times s, stiffness times s^2: the same motion, times s. Cubes of 0.05 mm and 3.3 km;
    even powers of two (and their roots) add no round-off that friction and contact could amplify.
    """
    scaled = states(falling(cube("near", NEAR, scale, 2e4 * scale**2), scale=scale))
    apart = np.abs(scaled / scale - alone).max(axis=(1, 2)) / (np.sqrt(3) * SIDE)
    assert (apart <= 1e-14 * np.arange(STEPS + 1)).all()  # round-off, as it adds up step by step


def test_the_diagonal_is_that_of_the_smallest_body_that_is_not_held():
    everywhere = lambda X: np.ones(len(X), dtype=bool)
    large, small = cube("large", NEAR, 3.0), cube("small", (5.0, 1.0, 0.0))
    diagonal = np.sqrt(3) * SIDE
    held = lambda **how: falling(large, small, supports=(Support(everywhere, body="small", **how),))
    assert scene_diagonal(falling(large)) == pytest.approx(3 * diagonal)
    assert scene_diagonal(falling(large, small)) == pytest.approx(diagonal)
    assert scene_diagonal(held()) == pytest.approx(3 * diagonal)
    assert scene_diagonal(held(release=0.1)) == pytest.approx(diagonal)
    assert scene_diagonal(falling(large, small, supports=(Support(everywhere),))) == pytest.approx(diagonal)
    sides = Support(lambda X: X[:, 0] < 5.0, body="small"), Support(lambda X: X[:, 0] >= 5.0, body="small")
    assert scene_diagonal(falling(large, small, supports=sides)) == pytest.approx(3 * diagonal)


def test_lengths_in_metres_stay():
    assert metres(0.002, 7.0) == 0.002 and metres(Relative(0.002), 7.0) == pytest.approx(0.014)
