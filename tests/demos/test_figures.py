"""Every flat figure of the demos is a shape that the pre-flight checks accept, of the area it promises; test_demos.py
has the others.
"""

from pathlib import Path

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.meshing.triangulate import boundary_loops
from pdvol.meshing.validate import check_outline, check_solid, signed_area
from pdvol.runs.scene_file import load_module

recipes = load_module(Path(__file__).resolve().parents[2] / "demos" / "ape.py").recipes


def squares():
    """A rectangle of 8 square metres without two of one."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    inner = [meshes.polygon(np.array(at) + corners) for at in ((1.0, 0.0), (-1.0, 0.2))]
    return recipes.toys.pierced(meshes.rectangle(4.0, 2.0), *inner)


def arcs(parts: int) -> float:
    """Area that a corner of radius 1 loses, drawn as `parts` chords."""
    return 1.0 - parts / 2 * np.sin(np.pi / 2 / parts)


def gear_area(radius, teeth, tooth, share):
    """Its chords within the feet, and a trapezoid a tooth on the chord of its foot."""
    half, gap = np.pi * share / teeth, (2 * np.pi / teeth) * (1 - share) / 3
    wheel = teeth * radius**2 / 2 * (np.sin(2 * half) + 3 * np.sin(gap))
    return wheel + teeth * tooth * 1.7 * radius * np.sin(half)


line = np.column_stack([np.linspace(0, 1, 9), np.zeros(9)])
FLAT = {
    # name: (what makes the outline or mesh, area by hand [m^2] or None, holes, height [m] or None)
    # The arcs of a trampoline take from eight corners, of which two inner ones give as much back.
    "trampoline": (
        lambda: recipes.trampoline(2.0, 0.5, 0.1, 0.1),
        2.0 * 0.1 + 2 * 0.1 * 0.4 - 4 * 0.04**2 * arcs(6),
        0,
        None,
    ),
    "gear": (lambda: recipes.gear(0.3, 20, 0.1, 0.35), gear_area(0.3, 20, 0.1, 0.35), 0, None),
    "stroke": (lambda: recipes.toys.stroke(line, 0.2, cap=200), 0.2 + np.pi * 0.1**2, 0, None),
    "worm": (recipes.worm, None, 0, None),
    "seahorse": (lambda: recipes.seahorse(0.8, points=500), None, 0, 0.8),
    "A": (lambda: recipes.letter("A", 0.7), None, 1, 0.7),
    "B": (lambda: recipes.letter("B", 0.7), None, 2, 0.7),
    "C": (lambda: recipes.letter("C", 0.7), None, 0, 0.7),
    "propeller": (recipes.propeller, None, 1, None),
    "beach ball": (lambda: recipes.beach_ball(0.3, 6, 96), 0.5 * 96 * 0.09 * np.sin(2 * np.pi / 96), 0, None),
    "pierced": (squares, 8.0 - 2.0, 2, None),
}


@pytest.mark.parametrize("name", FLAT)
def test_flat_figures_have_their_area_holes_and_height(name):
    make, area, holes, height = FLAT[name]
    shape = make()
    if isinstance(shape, meshes.Outline):
        assert np.array_equal(check_outline(shape).points, shape.points), "it runs anticlockwise already"
        points, loops, found = shape.points, [shape.points], signed_area(shape.points)
    else:
        solid = check_solid(shape)
        edges = np.vstack([solid.cells[:, [0, 1]], solid.cells[:, [1, 2]], solid.cells[:, [2, 0]]])
        _, number, counts = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
        loops = boundary_loops(solid.vertices, edges[counts[number.ravel()] == 1].astype(np.int64), name)
        points, found = solid.vertices, simplex_volumes(solid.vertices, solid.cells).sum()
    areas = np.array([signed_area(loop) for loop in loops])
    assert (areas < 0).sum() == holes and (areas > 0).sum() == 1
    assert found == pytest.approx(areas.sum(), rel=1e-12), "no cell covers another or a hole"
    assert area is None or found == pytest.approx(area, rel=2e-4)
    assert height is None or np.ptp(points[:, 1]) == pytest.approx(height, rel=2e-3)  # rounded corners end just short


@pytest.mark.parametrize("layers", [1, 3])
def test_a_slice_has_its_layers(layers):
    outline, found = recipes.slices.bunny_outline(0.4, 160).points, recipes.bunny_slice(0.4, 0.01, 60, layers)
    check_solid(found, "slice")
    assert np.allclose(np.unique(found.vertices[:, 1]), np.linspace(-0.005, 0.005, layers + 1))
    assert simplex_volumes(found.vertices, found.cells).sum() == pytest.approx(0.01 * signed_area(outline), rel=1e-9)
