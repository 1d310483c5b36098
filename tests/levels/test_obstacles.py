"""Where obstacles are over time, as it is stored."""

import numpy as np
import pytest

from pdvol.errors import InputError
from pdvol.levels.obstacles import MOST_STORED_VERTICES, placed_obstacles, stored_obstacles
from pdvol.levels.script import Obstacle
from pdvol.scene import Plane, Still, Translation


def triangle(motion):
    corners, edges = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]), np.array([(0, 1), (1, 2), (2, 0)])
    return Obstacle("rock", "polyline", corners, edges, np.zeros((0, 3), dtype=int), motion)


def test_a_motion_of_another_dimension_is_refused_where_obstacles_are_placed():
    """Of pdvol's own motions later times are not checked; of users' own all are."""
    floor = Plane((0.0, 0.0), (0.0, 1.0), motion=Translation((1.0, 0.0, 0.0)), name="floor")
    with pytest.raises(InputError, match="plane 'floor': its motion at t = 0 s failed"):
        placed_obstacles((floor,))
    (late,) = placed_obstacles((Plane((0.0, 0.0), (0.0, 1.0), motion=lambda X, t: X if t < 1.0 else X[:1]),))
    with pytest.raises(InputError, match="its motion at t = 1 s must give an array of shape"):
        late.at(1.0)


def test_places_of_moving_obstacles_are_stored_up_to_half_a_gigabyte():
    """One state more is refused before any is computed; what rests is stored once, however many steps there are."""
    moving, still = triangle(Translation((1.0, 0.0))), triangle(Still())
    states = MOST_STORED_VERTICES // 3
    with pytest.raises(InputError, match="3 vertices of moving obstacles over 6,666,666 steps are too many to keep"):
        stored_obstacles((moving, still), 0.01, states)
    (entry,) = stored_obstacles((still,), 0.01, states)
    assert "positions" not in entry
    (entry,) = stored_obstacles((moving,), 0.01, 2)
    np.testing.assert_allclose(entry["positions"], moving.vertices + 0.01 * np.arange(3)[:, None, None] * [1.0, 0.0])
    assert MOST_STORED_VERTICES * 3 * np.dtype(float).itemsize < 0.5e9
