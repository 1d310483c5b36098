"""Closest points of segments."""

import numpy as np
import pytest

from pdvol.geometry.closest_points import closest, segment_distances


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-7, 1e-3, 1.0])
def test_distances_of_segments(angle):
    """Of segments of all lengths and places, from parallel to across, some of them nearly points, against a search
    along them.
    """
    rng = np.random.default_rng(3)
    a, c = rng.uniform(-1, 1, (2, 500, 3))
    e = rng.standard_normal((500, 3)) * 10.0 ** rng.uniform(-3, 0, (500, 1))
    f = rng.choice([-3.0, -0.1, 1e-9, 0.5, 2.0], (500, 1)) * (
        e + angle * np.linalg.norm(e, axis=1)[:, None] * rng.standard_normal((500, 3))
    )
    found = segment_distances(a, a + e, c, c + f)
    low, high = np.zeros(500), np.ones(500)
    for _ in range(80):  # thirds: the distance of a point on ab to cd is convex in where that point is
        places = low + (high - low) / 3.0, high - (high - low) / 3.0
        nearer = np.less(*(distance_to(c, f, a + s[:, None] * e) for s in places))
        low, high = np.where(nearer, low, places[0]), np.where(nearer, places[1], high)
    expected = distance_to(c, f, a + low[:, None] * e)
    assert np.all(found >= expected - 1e-7)
    assert np.all(found <= expected + 1e-6 * np.linalg.norm(e, axis=1) + 1e-9)


def test_closest_points_of_parallel_lines_are_numbers_of_the_segments_size():
    """Where any pair of points is closest: not a rounding error over another one, whose products overflow."""
    rng = np.random.default_rng(0)
    a, c, e = rng.standard_normal((3, 1000, 3))
    assert np.abs(closest(a, a + e, c, c + 2.0 * e)).max() < 1.0


@pytest.mark.parametrize("angle", [1e-5, 1e-3, 1.0])
def test_closest_points_of_lines_that_are_hardly_parallel(angle):
    """Through each other's middle, one above the other."""
    way = 0.5 * np.array([[np.cos(angle), np.sin(angle), 0.0]])
    a, b, up = np.array([[0.0, 0.0, 0.0]]), np.array([[1.0, 0.0, 0.0]]), np.array([[0.5, 0.0, 0.2]])
    np.testing.assert_allclose(closest(a, b, up - way, up + way), 0.5, atol=1e-4)


def distance_to(c, f, p):
    t = np.clip(np.einsum("kd,kd->k", p - c, f) / np.einsum("kd,kd->k", f, f), 0.0, 1.0)
    return np.linalg.norm(p - c - t[:, None] * f, axis=1)
