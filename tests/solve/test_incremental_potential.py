"""How forces of contact change while obstacles move: what Newton's direction is given of their motion."""

import numpy as np
import pytest

from pdvol.potentials.potential import Positions
from pdvol.scene import Barrier, Plane, Translation
from problems import block, make_scene, make_stepper

DHAT, SPEED, START = 0.01, 1.0, 0.002  # m, m/s, s


def pushed(gap):
    """A potential whose plane rises towards a block, `gap` [m] below it at `START`, and the block's positions."""
    scene = make_scene(
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), Translation((0.0, SPEED))),), contact=(Barrier(dhat=DHAT),)
    )
    low = SPEED * START + gap
    problem = make_stepper(scene, block((0.0, low), (0.2, low + 0.2), 1))
    x = Positions(problem.space, problem.space.from_input(problem.space.mesh.points))
    problem.potential.begin_step(x, x.owned, 1e-4, 0.0, 0.01)
    problem.potential.move_obstacles(START)
    return problem.potential, x


@pytest.mark.parametrize("gap", [0.01 * DHAT, 0.3 * DHAT])
@pytest.mark.parametrize("path", [0.1 * DHAT, DHAT])
def test_the_change_of_forces_is_their_derivative_along_the_obstacles_path(gap, path):
    """Whether or not the path goes through the block: it is measured over a small share of it. The obstacle stays where
    it is.
    """
    potential, x = pushed(gap)
    here = potential.gradient(x)
    change = potential.gradient_change(x, START, START + path / SPEED)
    np.testing.assert_array_equal(potential.gradient(x), here)
    around, h = [], 1e-4 * gap / SPEED
    for time in (START - h, START + h):
        potential.move_obstacles(time)
        around.append(potential.gradient(x))
    expected = (around[1] - around[0]) / (2.0 * h) * path / SPEED
    assert np.abs(expected).max() > 0.0
    np.testing.assert_allclose(change, expected, atol=2e-3 * np.abs(expected).max())


def test_nothing_is_said_of_a_contact_nearer_than_the_difference():
    potential, x = pushed(1e-7 * DHAT)
    np.testing.assert_array_equal(potential.gradient_change(x, START, START + DHAT / SPEED), 0.0)
