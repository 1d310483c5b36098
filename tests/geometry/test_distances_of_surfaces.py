"""Signed distances from closed surfaces, against those of a sphere and a box by hand."""

import numpy as np
import pytest
import trimesh

from pdvol.geometry.distances import deepest_inside, is_closed, signed_distance


@pytest.mark.parametrize("turned", [False, True])
def test_a_box_whichever_way_its_triangles_point(turned):
    box = trimesh.creation.box((2.0, 2.0, 2.0))
    faces = box.faces[:, ::-1] if turned else box.faces
    points = np.array([[0.0, 0, 0], [0.9, 0, 0], [1.5, 0, 0], [2.0, 2.0, 1.0], [0.3, -0.8, 0.1]])
    found = signed_distance(points, box.vertices, faces)
    np.testing.assert_allclose(found, [-1.0, -0.1, 0.5, np.sqrt(2.0), -0.2], atol=1e-12)
    assert deepest_inside(points[1:], box.vertices, faces) == pytest.approx(0.2, abs=1e-12)
    assert deepest_inside(points[2:4], box.vertices, faces) == 0.0
    assert deepest_inside(points[:0], box.vertices, faces) == 0.0


def test_random_points_about_a_ball():
    ball = trimesh.creation.icosphere(4)
    points = np.random.default_rng(0).normal(size=(500, 3))
    np.testing.assert_allclose(
        signed_distance(points, ball.vertices, ball.faces), np.linalg.norm(points, axis=1) - 1.0, atol=3e-3
    )


def test_what_is_closed():
    ball = trimesh.creation.icosphere(1)
    assert is_closed(ball.faces) and not is_closed(ball.faces[1:]) and not is_closed(ball.faces[:0])
