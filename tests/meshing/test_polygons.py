"""Polygons are cut into triangles with an area, which use every corner and cover the polygon once."""

import time

import numpy as np
import pytest

from pdvol.meshing.polygons import MOST_CORNERS, cut_faces, cut_polygons

TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
"""A rotation or reflection of space: polygons lie in no coordinate plane."""
SQUARE = [(0, 0), (1, 0), (2, 0), (2, 1), (2, 2), (0, 2)]
COMB = [(0, 0), (5, 0), (5, 3), (4, 3), (4, 1), (3, 1), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]

RING = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0), (1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]  # with a bridge to its hole


def placed(corners):
    return np.column_stack([np.array(corners, dtype=float), np.zeros(len(corners))]) @ TURN.T


def area_vectors(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize(("corners", "area"), [(SQUARE, 4.0), (COMB, 11.0), (RING, 12.0)])
@pytest.mark.parametrize("first", [0, 1, 4])
def test_each_corner_is_used_and_the_area_kept(corners, area, first):
    points = placed(corners)
    polygon = np.roll(np.arange(len(corners)), -first)
    (triangles,) = cut_polygons(points, polygon[None])
    assert len(triangles) == len(corners) - 2 and set(triangles.ravel()) == set(polygon)
    vectors = area_vectors(points, triangles)
    normal = vectors.sum(axis=0)
    assert np.linalg.norm(normal) == pytest.approx(area)
    # All triangles look the same way as the polygon, and none is a sliver: they cover it once.
    assert (vectors @ normal > 0.05 * normal @ normal / area).all()
    # Each side of the polygon belongs to one triangle, in its direction.
    sides = {(int(t[k]), int(t[(k + 1) % 3])) for t in triangles for k in range(3)}
    assert {(int(a), int(b)) for a, b in zip(polygon, np.roll(polygon, -1), strict=True)} <= sides


def test_convex_polygons_are_fans_as_ever():
    angles = np.linspace(0, 2 * np.pi, 7, endpoint=False)
    points = placed(np.column_stack([np.cos(angles), np.sin(angles)]))
    assert cut_polygons(points, np.arange(7)[None])[0].tolist() == [[0, k, k + 1] for k in range(1, 6)]
    cut = cut_faces(points, [[0, 1, 2], [0, 2, 3, 4], [4, 5, 6]]).tolist()
    assert cut == [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 5, 6]]


def test_the_largest_polygon_takes_a_second_at_most_and_larger_ones_are_refused():
    angles = np.linspace(0, 2 * np.pi, MOST_CORNERS, endpoint=False)
    radii = np.where(np.arange(MOST_CORNERS) % 2, 1.0, 0.8)
    star = placed(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]))
    begin = time.process_time()
    (triangles,) = cut_polygons(star, np.arange(MOST_CORNERS)[None])
    assert time.process_time() - begin < 3.0
    vectors = area_vectors(star, triangles)
    assert (vectors @ vectors.sum(axis=0) > 0.0).all()
    more = np.vstack([star, star[:2] * 1.01])
    with pytest.raises(ValueError, match=f"{MOST_CORNERS + 2} corners"):
        cut_polygons(more, np.arange(MOST_CORNERS + 2)[None])
