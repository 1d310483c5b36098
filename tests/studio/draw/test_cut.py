"""Cut-aways take away what lies before a plane, and close what they cut."""

import numpy as np
import pytest
from PIL import Image

import runs
from pdvol import meshes
from pdvol.cli import run as command_line
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.draw.cut import Cut, read_cut
from pdvol.studio.draw.picture import render

BRICK = meshes.brick((2.0, 1.0, 1.0), (4, 2, 2))


def areas(points, triangles):
    a, b, c = points[triangles].transpose(1, 0, 2)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.mark.parametrize(("towards", "low", "high"), [(1.0, -1.0, 0.3), (-1.0, 0.3, 1.0)])
def test_what_lies_before_the_plane_is_gone_and_the_section_is_closed(towards, low, high):
    points, triangles = Cut(0, 0.3).solid(BRICK.vertices, BRICK.cells, np.array([towards, 0.5, 0.5]))
    assert points[:, 0].min() == pytest.approx(low) and points[:, 0].max() == pytest.approx(high)
    middles = points[triangles].mean(axis=1)
    section = np.abs(middles[:, 0] - 0.3) < 1e-9
    assert areas(points, triangles[section]).sum() == pytest.approx(1.0), "the section is the whole cross-section"
    # Two ends of 1 m^2 and four sides.
    assert areas(points, triangles).sum() == pytest.approx(2.0 + 4.0 * (high - low))


def test_a_surface_stays_open_and_may_vanish():
    ball, towards = meshes.ball(1.0, 3), np.array([0.0, 0.0, 1.0])
    points, triangles = Cut(2, 0.0, ("bowl",)).surface(ball.vertices, ball.triangles, towards)
    assert points[:, 2].max() <= 1e-12
    assert areas(points, triangles).sum() == pytest.approx(2.0 * np.pi, rel=0.02)
    gone, none = Cut(2, -2.0).surface(ball.vertices, ball.triangles, towards)
    assert len(gone) == len(none) == 0


def test_names_choose_what_is_cut():
    every, one = Cut(0, 0.0), Cut(0, 0.0, ("bowl",))
    assert every.through("ball", True) and not every.through("bowl", False)
    assert one.through("bowl", False) and not one.through("ball", True)
    assert read_cut("y=-0.5:ball,bowl", ["ball"], ["bowl"]) == Cut(1, -0.5, ("ball", "bowl"))
    assert read_cut("", [], []) is None


@pytest.mark.parametrize("text", ["z", "w=1", "z=", "z=nan", "z=0:", "0.3", "z=0:cup"])
def test_other_texts_are_refused_in_one_line(text):
    with pytest.raises(InputError, match="--cut") as caught:
        read_cut(text, ["ball"], ["bowl"])
    assert "\n" not in str(caught.value)


def test_a_picture_shows_what_is_inside(tmp_path):
    run = runs.stored_run(tmp_path / "run", 3, (60,), 2)
    pictures = []
    for more in ([], ["--cut", "z=0"]):
        out = tmp_path / f"{len(more)}.png"
        assert command_line(["render", str(run), "-o", str(out), "--size", "900x200", *more]) == 0
        pictures.append(np.asarray(Image.open(out), dtype=float))
    assert np.abs(pictures[0] - pictures[1]).max() > 50.0


def test_flat_scenes_have_nothing_to_take_away(tmp_path):
    run = runs.stored_run(tmp_path / "run", 2, (60,), 2)
    with pytest.raises(InputError, match="--cut: .* is 2D"):
        render(open_run(run), tmp_path / "flat.png", cut="x=0")
