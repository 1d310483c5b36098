"""Every figure of the demos is a shape that the pre-flight checks accept, of the size it promises."""

from pathlib import Path

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.meshing.decimate import topology
from pdvol.meshing.triangulate import boundary_loops
from pdvol.meshing.validate import check_outline, check_solid, check_surface, signed_area
from pdvol.runs.scene_file import load_module

recipes = load_module(Path(__file__).resolve().parents[2] / "demos" / "ape.py").recipes
"""As the demos import them: a figure that another test has made is made once."""


def _arc_share(parts: int) -> float:
    """Area of a quarter disc of radius 1 drawn as `parts` chords."""
    return parts / 2 * np.sin(np.pi / 2 / parts)


def gear_area(radius, teeth, tooth, share):
    """Its chords within the feet, and a trapezoid a tooth on the chord of its foot."""
    half, gap = np.pi * share / teeth, (2 * np.pi / teeth) * (1 - share) / 3
    wheel = teeth * radius**2 / 2 * (np.sin(2 * half) + 3 * np.sin(gap))
    return wheel + teeth * tooth * 1.7 * radius * np.sin(half)


OUTLINES = {
    # name: (what makes the outline, area by hand)
    # The bed and two legs, less what the arcs take from the eight corners: two of them are inner ones and give as much
    # back.
    "trampoline": (
        lambda: recipes.trampoline(2.0, 0.5, 0.1, 0.1),
        2.0 * 0.1 + 2 * 0.1 * 0.4 - 4 * 0.04**2 * (1.0 - _arc_share(6)),
    ),
    # 20 teeth: trapezoids on the chords of a polygon with five corners a tooth.
    "gear": (lambda: recipes.gear(0.3, 20, 0.1, 0.35), gear_area(0.3, 20, 0.1, 0.35)),
    "stroke": (
        lambda: recipes.toys.stroke(np.column_stack([np.linspace(0, 1, 9), np.zeros(9)]), 0.2, cap=200),
        0.2 + np.pi * 0.1**2,
    ),
}
FLAT = {
    # name: (what makes the mesh, area by hand or None, holes)
    "A": (lambda: recipes.letter("A"), None, 1),
    "B": (lambda: recipes.letter("B"), None, 2),
    "propeller": (recipes.propeller, None, 1),
    "beach ball": (lambda: recipes.beach_ball(0.3, 6, 96), 0.5 * 96 * 0.09 * np.sin(2 * np.pi / 96), 0),
    "pierced": (
        lambda: recipes.toys.pierced(
            meshes.rectangle(4.0, 2.0),
            *(
                meshes.polygon(np.array([x, y]) + [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
                for x, y in ((1.0, 0.0), (-1.0, 0.2))
            ),
        ),
        8.0 - 2.0,
        2,
    ),
}


@pytest.mark.parametrize("name", OUTLINES)
def test_outlines_have_their_area(name):
    make, area = OUTLINES[name]
    outline = make()
    checked = check_outline(outline)
    assert np.array_equal(checked.points, outline.points), "it runs anticlockwise already"
    assert signed_area(outline.points) == pytest.approx(area, rel=2e-4)


def test_the_dolphin_is_whole():
    animal = recipes.dolphin(2.0, 1500)
    checked = check_surface(animal, "dolphin")
    assert topology(checked.triangles, len(checked.vertices)) == (1, 2)
    assert np.ptp(animal.vertices[:, 1]) == pytest.approx(2.0) and 1200 <= len(animal.vertices) <= 1600
    assert enclosed_volume(animal.vertices, animal.triangles) == pytest.approx(8 * 0.022, rel=0.1)


def test_the_ape_is_whole_stands_flat_and_has_one_arm_up():
    ape = recipes.ape()
    checked = check_surface(ape, "ape")
    assert topology(checked.triangles, len(checked.vertices)) == (1, 2)
    assert 4500 <= len(ape.vertices) <= 5500
    x, y, z = ape.vertices.T
    assert y.min() == 0.0 and y[abs(x) < 0.2].max() == pytest.approx(1.0)
    ground = y < 0.01
    for part in (
        ground & (abs(x) < 0.2) & (z < 0.2),
        ground & (x > 0) & (z > 0.4),
        ground & (x < 0) & (z > 0.4),
        ground & (x < -0.4) & (z < 0.35),
    ):
        assert part.sum() >= 10, "seat, both soles and the right fist rest on the ground"
    assert y[x > 0.5].min() > 0.4, "the left arm does not"


@pytest.mark.parametrize("name", FLAT)
def test_flat_meshes_have_their_area_and_holes(name):
    make, area, holes = FLAT[name]
    mesh = make()
    solid = check_solid(mesh)
    edges = np.vstack([solid.cells[:, [0, 1]], solid.cells[:, [1, 2]], solid.cells[:, [2, 0]]])
    _, number, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    loops = boundary_loops(solid.vertices, edges[counts[number.ravel()] == 1].astype(np.int64), name)
    areas = np.array([signed_area(loop) for loop in loops])
    assert (areas < 0).sum() == holes and (areas > 0).sum() == 1
    filled = simplex_volumes(solid.vertices, solid.cells).sum()
    assert filled == pytest.approx(areas.sum(), rel=1e-12), "no cell covers another or a hole"
    assert area is None or filled == pytest.approx(area, rel=1e-12)


@pytest.mark.parametrize("make", [lambda: recipes.letter("C"), recipes.worm], ids=["C", "worm"])
def test_drawn_outlines_run_anticlockwise(make):
    outline = make()
    assert np.array_equal(check_outline(outline).points, outline.points)


def test_letters_are_as_tall_as_asked():
    for name in "ABC":
        shape = recipes.letter(name, 0.7)
        points = shape.points if isinstance(shape, meshes.Outline) else shape.vertices
        assert np.ptp(points[:, 1]) == pytest.approx(0.7, rel=2e-3)  # rounded corners may end just short of it


def test_the_ball_has_equal_panels():
    ball = recipes.beach_ball(0.2, 6, 96)
    areas = np.bincount(ball.regions, simplex_volumes(ball.vertices, ball.cells))
    assert np.allclose(areas[1:], areas[1]) and len(areas) == 7


@pytest.mark.parametrize("layers", [1, 3])
def test_a_slice_has_its_layers(layers):
    outline, found = recipes.slices.bunny_outline(0.4, 160).points, recipes.bunny_slice(0.4, 0.01, 60, layers)
    check_solid(found, "slice")
    assert np.allclose(np.unique(found.vertices[:, 1]), np.linspace(-0.005, 0.005, layers + 1))
    volume = simplex_volumes(found.vertices, found.cells).sum()
    assert volume == pytest.approx(0.01 * signed_area(outline), rel=1e-9)
    assert np.allclose(found.vertices[:, 1].mean(), 0.0) and len(found.vertices) % (layers + 1) == 0


def test_the_seahorse_has_its_height_and_repeats():
    figure = recipes.seahorse(0.8, points=500)
    assert check_outline(figure).points[:, 1].min() == 0.0
    assert figure.points[:, 1].max() == pytest.approx(0.8) and len(figure.points) == 500
    assert np.array_equal(figure.points, recipes.seahorse(0.8, points=500).points)
    length = lambda outline: np.linalg.norm(outline.points - np.roll(outline.points, 1, axis=0), axis=1).sum()
    assert length(recipes.seahorse()) > 1.07 * length(recipes.seahorse(ridges=1)), "knobs make its outline longer"


@pytest.mark.parametrize(
    ("figure", "axis", "size"),
    [
        (lambda: recipes.leaf_sheep(0.36, 24000), 2, 0.36),
        (lambda: recipes.sea_mushroom(0.6, 6000), 1, 0.6),
        (lambda: recipes.stone(0.34, 1200), 0, 0.34),
        (lambda: recipes.gnome(0.6, 8000), 1, 0.6),
    ],
    ids=["leaf sheep", "sea mushroom", "stone", "gnome"],
)
def test_figures_are_whole_and_have_their_size(figure, axis, size):
    shape = figure()
    checked = check_surface(shape)
    assert topology(checked.triangles, len(checked.vertices)) == (1, 2)
    assert np.ptp(shape.vertices[:, axis]) == pytest.approx(size, rel=2e-3)
    assert enclosed_volume(shape.vertices, shape.triangles) > 0.0


@pytest.mark.slow
def test_letters_are_cut_out_of_the_block():
    block = recipes.letter_block(1.0, 0.1, 4000)
    checked = check_surface(block)
    assert topology(checked.triangles, len(checked.vertices)) == (1, 2)
    assert np.ptp(block.vertices[:, 1]) == pytest.approx(1.0, rel=2e-3)
    volume = enclosed_volume(block.vertices, block.triangles)
    # Five letters of some 2 x 0.058 times the length of their strokes, 1.3 to 2.3, and rounded edges.
    assert 1.0 - 5 * 0.1 * 0.3 < volume < 1.0 - 5 * 0.1 * 0.13
    top = block.vertices[(np.abs(block.vertices[:, [0, 2]]) < 0.34).all(axis=1) & (block.vertices[:, 1] > 0.2)]
    assert top[:, 1].min() == pytest.approx(0.4, abs=0.01), "the floor of the letter above"
