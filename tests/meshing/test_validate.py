"""Each defect of a shape is refused in one line that names its primitives."""

import numpy as np
import pytest

from hostile_files import shifted, together
from pdvol.errors import IntersectionError, InvertedCellError, MeshError
from pdvol.meshes import Outline, Solid, Surface, ball, box
from pdvol.meshing.validate import check_outline, check_solid, check_surface


def two_of(surface, by):
    return Surface(*together(shifted(surface, 0.0), shifted(surface, by)))


def refuse(check, shape, error, match):
    with pytest.raises(error, match=match) as caught:
        check(shape, "thing")
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith("thing")
    return caught.value


def test_a_good_surface_is_kept_and_unused_vertices_go():
    cube = box()
    extra = Surface(np.vstack([[[9.0, 9, 9]], cube.vertices]), cube.triangles + 1)
    assert np.array_equal(check_surface(extra).triangles, cube.triangles)
    turned = check_surface(Surface(cube.vertices, cube.triangles[:, ::-1])).triangles
    assert np.array_equal(np.sort(turned), np.sort(cube.triangles)), "turned outward without a word"


def test_bad_surfaces():
    cube = box()
    x, t = cube.vertices, cube.triangles
    assert len(check_surface(Surface(x, t[1:]), closed=False).triangles) == 11
    two = two_of(cube, 1.0)  # welded in one corner
    welded, of = np.unique(two.vertices, axis=0, return_inverse=True)
    nan, far, turned = x.copy(), t.copy(), t.copy()
    nan[3, 1], far[5, 0], turned[4] = np.nan, 99, t[4, ::-1]
    for points, triangles, match in (
        (nan, t, "vertices 3 have NaN"),
        (x, far, "triangles 5 use vertices that do not exist"),
        (np.empty((0, 3)), t[:0], "empty"),
        (x[:, :2], t, "do not fit"),
        (x, np.vstack([t, [[0, 1, 1]]]), "triangles 12 have no area"),
        (x, np.vstack([t, np.roll(t[2:3], 1, axis=1)]), "triangles 12 repeat"),
        (x, t[1:], "open along 3 edges"),
        (np.vstack([x, [[0, 0, 0]]]), np.vstack([t, [[*t[0, :2], len(x)]]]), "non-manifold"),
        (x, turned, "disagree on what is outside"),
        (welded, of.ravel()[two.triangles], "single vertices"),
    ):
        refuse(check_surface, Surface(points, triangles), MeshError, match)


def test_self_intersections_name_two_triangles_that_cross():
    two = two_of(ball(1.0, 1), (1.2, 0.1, 0.05))
    assert len(refuse(check_surface, two, IntersectionError, r"triangles \d+ and \d+ cross").pairs) > 0
    refuse(check_surface, two_of(box(), (1.0, 0.25, 0.25)), IntersectionError, "cross|touches")


def test_a_heap_of_overlapping_shells_is_refused_before_all_pairs_are_listed():
    """30,000 tetrahedra in one place: a billion pairs of boxes overlap."""
    rng = np.random.default_rng(0)
    corners = rng.random((30_000, 4, 3))
    turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    corners[turned, :2] = corners[turned, 1::-1]
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    triangles = (4 * np.arange(len(corners))[:, None, None] + faces).reshape(-1, 3)
    refuse(check_surface, Surface(corners.reshape(-1, 3), triangles), IntersectionError, "cross, in a sample of 500")


def test_outlines():
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    assert np.array_equal(check_outline(Outline(square[::-1])).points, square)
    refuse(check_outline, Outline(square[[0, 2, 1, 3]]), IntersectionError, "segments 0 and 2 cross")
    refuse(check_outline, Outline(np.vstack([square, square[:1]])), MeshError, "segments 4 have no length")
    refuse(check_outline, Outline(square[:2]), MeshError, "at least 3")
    refuse(check_outline, Outline(np.where(square == 1.0, np.inf, square)), MeshError, "NaN or infinite")
    assert len(check_outline(Outline(square[:2]), closed=False).points) == 2


POINTS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [5, 5, 5]])
CELLS = np.array([[0, 1, 2, 3], [1, 4, 2, 3]])  # the second has volume +1/3


def test_solids():
    none = np.zeros(2, dtype=int)
    good = check_solid(Solid(POINTS, CELLS, none))
    assert len(good.vertices) == 5, "the unused vertex is dropped"
    inverted = check_solid(Solid(POINTS, CELLS[:, [1, 0, 2, 3]], none)).cells
    assert np.array_equal(inverted, good.cells), "all inverted: turned"
    bad = CELLS.copy()
    bad[1] = bad[1, [1, 0, 2, 3]]
    assert refuse(check_solid, Solid(POINTS, bad, none), InvertedCellError, "cells 1 are inverted").cells == (1,)
    flat = POINTS.copy()
    flat[3] = [0.3, 0.3, 0.0]
    assert refuse(check_solid, Solid(flat, CELLS, none), InvertedCellError, "cells 0 are flat").cells == (0,)
    refuse(check_solid, Solid(POINTS, CELLS[[0, 0]], none), MeshError, "cells 1 repeat")
    refuse(check_solid, Solid(POINTS * np.nan, CELLS, none), MeshError, "NaN")
    refuse(check_solid, Solid(POINTS, CELLS[:, :3], none), MeshError, "give tetrahedra")
    refuse(check_solid, Solid(POINTS, CELLS, none[:1]), MeshError, "region labels")
    plane = Solid(np.array([[0.0, 0], [1, 0], [0, 1], [2, 0]]), np.array([[0, 1, 2], [0, 1, 3]]), none)
    assert refuse(check_solid, plane, InvertedCellError, "flat").cells == (1,)
