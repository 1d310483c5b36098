"""Cut-aways take away what lies before a plane, and close what they cut."""

import numpy as np
import pytest
import pyvista as pv

from pdvol import meshes
from pdvol.errors import InputError
from pdvol.studio.draw.cut import Cut, read_cut, triangles

BRICK = meshes.brick((2.0, 1.0, 1.0), (4, 2, 2))


def areas(points, corners):
    a, b, c = points[corners].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.mark.parametrize(("towards", "low", "high"), [(1.0, -1.0, 0.3), (-1.0, 0.3, 1.0)])
def test_what_lies_before_the_plane_is_gone_and_the_section_is_closed(towards, low, high):
    solid = pv.UnstructuredGrid({pv.CellType.TETRA: BRICK.cells}, BRICK.vertices)
    points, corners = triangles(Cut(0, 0.3).left(solid, np.array([towards, 0.5, 0.5])))
    assert points[:, 0].min() == pytest.approx(low) and points[:, 0].max() == pytest.approx(high)
    section = np.abs(points[corners].mean(axis=1)[:, 0] - 0.3) < 1e-9
    assert areas(points, corners[section]).sum() == pytest.approx(1.0), "the section is the whole cross-section"
    # Two ends of 1 m^2 and four sides.
    assert areas(points, corners).sum() == pytest.approx(2.0 + 4.0 * (high - low))


def test_a_surface_stays_open_and_what_is_cut_may_vanish():
    ball, towards = meshes.ball(1.0, 3), np.array([0.0, 0.0, 1.0])
    surface = pv.PolyData.from_regular_faces(ball.vertices, ball.triangles)
    points, corners = triangles(Cut(2, 0.0, ("bowl",)).left(surface, towards))
    assert points[:, 2].max() <= 1e-12
    assert areas(points, corners).sum() == pytest.approx(2.0 * np.pi, rel=0.02)
    solid = pv.UnstructuredGrid({pv.CellType.TETRA: BRICK.cells}, BRICK.vertices)
    for shape in (surface, solid):
        gone, none = triangles(Cut(2, -2.0).left(shape, towards))
        assert gone.shape == none.shape == (0, 3)


def test_texts_choose_what_is_cut():
    every, one = Cut(0, 0.0), Cut(0, 0.0, ("bowl",))
    assert every.through("ball", True) and not every.through("bowl", False)
    assert one.through("bowl", False) and not one.through("ball", True)
    assert read_cut("y=-0.5:ball,bowl", ["ball"], ["bowl"]) == Cut(1, -0.5, ("ball", "bowl"))
    assert read_cut("", [], []) is None
    for text in ("z", "w=1", "z=", "z=nan", "z=0:", "0.3", "z=0:cup"):
        with pytest.raises(InputError, match="--cut") as caught:
            read_cut(text, ["ball"], ["bowl"])
        assert "\n" not in str(caught.value)
