"""Meshes get the volume that they should have, and surfaces are refined without a change of shape."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.distances import hausdorff_distance
from pdvol.geometry.level_mesh import facet_sizes, simplex_volumes
from pdvol.meshing.decimate import split_longest_edges, topology
from pdvol.meshing.tetrahedralise import tetrahedralise
from pdvol.meshing.triangulate import triangulate
from pdvol.meshing.validate import check_surface, signed_area
from pdvol.meshing.volume import with_volume

TRIANGLE = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]])


def test_a_triangle_grows_by_an_offset_then_by_scale():
    # Vertices move along the gradient of the area: away from the opposite side's middle, not along angle bisectors.
    cells = np.array([[0, 1, 2]])
    moved, scaled = with_volume(TRIANGLE, cells, 7.0)
    steps = np.linalg.norm(moved - TRIANGLE, axis=1)
    assert steps == pytest.approx(np.full(3, steps[0])) and steps[0] > 0.05
    middle = TRIANGLE.mean(axis=0)
    assert scaled == pytest.approx(middle + np.sqrt(7.0 / 6.0) * (TRIANGLE - middle))
    for points in (moved, scaled):
        assert simplex_volumes(points, cells).sum() == pytest.approx(7.0, rel=1e-12)


def test_levels_have_the_volume_of_their_shape():
    ball, outline = meshes.ball(1.0, 3), meshes.disc(1.0, 200).points
    for made, volume in (
        (tetrahedralise(ball, 200), enclosed_volume(ball.vertices, ball.triangles)),
        (tetrahedralise(ball, 200, volume=4.0), 4.0),
        (triangulate([outline], 400), signed_area(outline)),
    ):
        assert simplex_volumes(made.points, made.cells).sum() == pytest.approx(volume, rel=1e-9)


def test_split_edges_keep_the_shape():
    cube = meshes.box()
    fine = check_surface(split_longest_edges(cube, 301))
    assert len(fine.vertices) == 301
    assert topology(fine.triangles, 301) == (1, 2)
    area = lambda points, triangles: facet_sizes(points, triangles).sum()
    for size in (enclosed_volume, area):
        assert size(fine.vertices, fine.triangles) == pytest.approx(size(cube.vertices, cube.triangles))
    assert hausdorff_distance(fine.vertices, fine.triangles, cube.vertices, cube.triangles) < 1e-12
    corners = fine.vertices[fine.triangles]
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert lengths.max() <= 4.0 * lengths.min(), "the longest are split first"
    assert split_longest_edges(cube, 8) is cube


def test_hausdorff_distance_of_known_shapes():
    cube = meshes.box()
    moved = cube.vertices + [0.25, 0.0, 0.0]
    assert hausdorff_distance(cube.vertices, cube.triangles, moved, cube.triangles) == pytest.approx(0.25)
    # A triangle and the same one with a spike: only one of the two directions sees it.
    outline, spiked = TRIANGLE, np.vstack([TRIANGLE, [-2.0, 2.0]])
    edges, more = np.array([[0, 1], [1, 2], [2, 0]]), np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    assert hausdorff_distance(outline, edges, spiked, more) == pytest.approx(2.0)
    assert hausdorff_distance(spiked, more, outline, edges) == pytest.approx(2.0)
