"""Every recipe gives a shape that the pre-flight checks accept, of the size it promises."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.level_mesh import boundary_facets
from pdvol.meshing.decimate import topology
from pdvol.meshing.validate import check_outline, check_solid, check_surface, signed_area


def wave_length(length, waves, swing):
    """Of the curve x = swing sin(2 pi waves y / length)."""
    k = 2 * np.pi * waves / length
    y = np.linspace(0.0, length, 100_001)
    return np.trapezoid(np.sqrt(1 + (swing * k * np.cos(k * y)) ** 2), y)


OUTLINES = {
    # name: (outline, area by hand)
    "disc": (meshes.disc(2.0, 64), 0.5 * 64 * 4.0 * np.sin(2 * np.pi / 64)),
    "rectangle": (meshes.rectangle(2.0, 0.5), 1.0),
    "polygon, clockwise": (meshes.polygon([[0, 0], [0, 1], [1, 0]]), 0.5),
    "sharp spike": (meshes.spike(0.4, 1.0), 0.2),
    "spike on a base": (meshes.spike(0.4, 1.0, base=2.0, thickness=0.1), 0.2 + 0.2),
    "spike on a narrow base": (meshes.spike(0.4, 1.0, base=0.2, thickness=0.1), 0.2 + 0.04),
    "comb": (meshes.comb(teeth=3, length=1.0, width=0.1, gap=0.02, spine=0.2), 3 * 0.1 + 0.34 * 0.2),
    # A strip along a curve has its width times the curve's length: a straight one, and ends cut across the same
    # direction after whole waves.
    "straight rope": (meshes.rope(2.0, 0.05, swing=0.0), 0.1),
    "wavy rope": (meshes.rope(2.0, 0.05, waves=2.0, swing=0.1, points=400), 0.05 * wave_length(2.0, 2.0, 0.1)),
    # Three slits of height - bridge in a block of four strips.
    "slit array": (
        meshes.slit_array(slits=3, strip=0.1, height=1.0, slit=0.02, bridge=0.2),
        0.46 * 1.0 - 3 * 0.02 * 0.8,
    ),
    "one slit": (meshes.slit_array(slits=1, strip=0.1, height=1.0, slit=0.02, bridge=0.2), 0.22 * 1.0 - 0.02 * 0.8),
    "folded": (meshes.folded(1.0, 0.1, 0.02, arc=400), 2 * 0.1 + np.pi / 2 * (0.11**2 - 0.01**2)),
}
SURFACES = {
    # name: (surface, volume by hand, shells, Euler number)
    "ball": (meshes.ball(1.0, 4), 4 * np.pi / 3, 2),
    "box": (meshes.box((1.0, 2.0, 3.0), (2, 3, 4)), 6.0, 2),
    "bar": (meshes.bar(1.0, 0.2, 0.3, 0.1), 0.06, 2),
    "comb": (meshes.solids.comb(0.1, teeth=3, length=1.0, width=0.1, gap=0.02, spine=0.2), 0.0368, 2),
    "folded": (meshes.solids.folded(0.1, length=1.0, width=0.1, gap=0.02, arc=60), 0.1 * (0.2 + np.pi / 2 * 0.012), 2),
    "torus": (meshes.torus(0.35, 0.1, 96, 48), 2 * np.pi**2 * 0.35 * 0.1**2, 0),
    "cylinder": (meshes.cylinder(0.5, 2.0, 96), np.pi * 0.5**2 * 2.0, 2),
    "cone": (meshes.turned([(0.0, 0.0), (0.5, 1.0), (0.0, 1.0)], 96), np.pi * 0.5**2 / 3, 2),
    # Its wall is 0.02 m thick across: per height the ring between radii r and r + 0.02.
    "funnel": (
        meshes.funnel(0.4, 0.1, 0.5, 0.2, 0.02, 96),
        np.pi * (0.5 * (2 * 0.25 * 0.02 + 0.02**2) + 0.2 * (0.12**2 - 0.1**2)),
        0,
    ),
    # Between two half ellipsoids, and half a ring round the rim (Pappus: its middle is 4 r / 3 pi above the rim's
    # plane, at the same distance).
    "bowl": (
        meshes.bowl(1.0, 0.6, 0.1, 96, 40),
        2 * np.pi / 3 * (1.1**2 * 0.7 - 0.6) + np.pi * 0.05**2 / 2 * 2 * np.pi * 1.05,
        2,
    ),
}


@pytest.mark.parametrize("name", OUTLINES)
def test_outlines_are_valid_and_have_their_area(name):
    outline, area = OUTLINES[name]
    checked = check_outline(outline)
    assert np.array_equal(checked.points, outline.points), "it runs anticlockwise already"
    assert signed_area(outline.points) == pytest.approx(
        area, rel=2e-4
    )  # 2e-4: the folded strip's half ring is a polygon


@pytest.mark.parametrize("name", SURFACES)
def test_surfaces_are_valid_and_have_their_volume(name):
    surface, volume, euler = SURFACES[name]
    checked = check_surface(surface)
    assert np.array_equal(checked.triangles, surface.triangles), "it faces outward already"
    # 1e-2: spheres and rings are faceted
    assert enclosed_volume(surface.vertices, surface.triangles) == pytest.approx(volume, rel=1e-2)
    assert topology(checked.triangles, len(checked.vertices)) == (1, euler)


def test_a_rounded_tip_stays_below_the_sharp_one():
    sharp, rounded = meshes.spike(0.4, 1.0), meshes.spike(0.4, 1.0, tip_radius=0.05)
    assert check_outline(rounded).points[:, 1].max() < sharp.points[:, 1].max() - 0.05
    assert signed_area(rounded.points) < signed_area(sharp.points)


@pytest.mark.parametrize(
    ("make", "height"), [(meshes.creature, 1.0), (lambda: meshes.bunny(0.8), 0.8), (lambda: meshes.frog(0.5), 0.5)]
)
def test_figures_are_whole_and_stand_on_the_ground(make, height):
    figure = make()
    checked = check_surface(figure)
    assert topology(checked.triangles, len(checked.vertices)) == (1, 2) and 2000 <= len(figure.vertices) <= 4500
    assert enclosed_volume(figure.vertices, figure.triangles) > 0.0
    assert figure.vertices[:, 1].min() == 0.0 and figure.vertices[:, 1].max() == pytest.approx(height)
    if make is meshes.creature:
        assert np.array_equal(figure.vertices, make.__wrapped__().vertices), "it repeats"
    else:
        assert abs(figure.vertices[:, 0].min() + figure.vertices[:, 0].max()) < 0.02 * height, "it is mirrored"


def cell_volumes(solid):
    """Of tetrahedra, all positive."""
    corners = solid.vertices[solid.cells]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert volumes.min() > 0.0
    return volumes


@pytest.mark.parametrize("layers", [1, 2])
def test_a_hollow_ball_is_a_wall_round_a_cavity(layers):
    ball, inside = meshes.ball(0.5, 2), meshes.ball(0.4, 2)
    hollow = meshes.hollow_ball(0.5, 0.1, 2, layers)
    assert len(hollow.vertices) == (layers + 1) * len(ball.vertices)
    wall = enclosed_volume(ball.vertices, ball.triangles) - enclosed_volume(inside.vertices, inside.triangles)
    assert cell_volumes(hollow).sum() == pytest.approx(wall, rel=1e-12)
    facets, _ = boundary_facets(hollow.cells)
    assert len(facets) == 2 * len(ball.triangles)
    with pytest.raises(ValueError, match="thickness"):
        meshes.hollow_ball(0.5, 0.5)


def test_bricks_fill_their_boxes_but_for_inner_ones():
    brick = meshes.brick((1.0, 0.5, 0.25), (3, 2, 1))
    assert cell_volumes(brick).sum() == pytest.approx(0.125)
    np.testing.assert_allclose(np.ptp(brick.vertices, axis=0), (1.0, 0.5, 0.25))
    bent = meshes.brick((1.0, 0.5, 0.25), (3, 2, 1), bend=lambda X: X + [5.0, 0.0, 0.0])
    np.testing.assert_allclose(bent.vertices, brick.vertices + [5.0, 0.0, 0.0])
    hollow = meshes.hollow_brick((1.0, 2.0, 0.5), (5, 6, 4), 1)
    assert cell_volumes(hollow).sum() == pytest.approx(1.0 * (1.0 - 3 * 4 * 2 / (5 * 6 * 4)))
    # All corners of the grid, but those within the cavity.
    assert len(hollow.vertices) == 6 * 7 * 5 - 2 * 3 * 1
    check_solid(hollow)
    with pytest.raises(ValueError, match="no cavity"):
        meshes.hollow_brick(cuts=(4, 4, 4), wall=2)
