"""Triangles: their number, and a boundary that follows the outline as coarsely as the level is."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.errors import MeshError
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshing.edge_length import ACCEPTED_DEVIATION
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.meshing.triangulate import boundary_loops, resample, triangulate

SHAPES = {"disc": meshes.disc(1.0, 200), "comb": meshes.comb(), "folded": meshes.folded(), "square": meshes.rectangle()}


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("target", [60, 310])
def test_a_mesh_of_the_wanted_size(name, target):
    outline = SHAPES[name].points
    mesh = triangulate([outline], target)
    assert abs(len(mesh.points) / target - 1.0) <= ACCEPTED_DEVIATION
    assert simplex_volumes(mesh.points, mesh.cells).min() > 0.0
    assert mean_ratio(mesh.points, mesh.cells).min() > 0.1
    x, y = outline.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert simplex_volumes(mesh.points, mesh.cells).sum() == pytest.approx(area, rel=2.0 / target + 0.005)


def test_corners_stay_and_points_lie_on_the_outline():
    square = meshes.rectangle(1.0, 1.0).points
    coarse = resample(square, 0.3)
    assert all((np.abs(coarse - corner).max(axis=1) < 1e-12).any() for corner in square)
    assert np.allclose(np.abs(coarse).max(axis=1), 0.5)
    assert np.linalg.norm(np.roll(coarse, -1, axis=0) - coarse, axis=1) == pytest.approx(np.full(12, 1 / 3))


def test_a_hole_stays_a_hole_and_loops_that_meet_are_refused():
    outer, hole = meshes.disc(1.0, 100).points, meshes.disc(0.4, 50).points[::-1]
    mesh = triangulate([outer, hole], 300)
    assert np.linalg.norm(mesh.points, axis=1).min() > 0.35
    facets, _ = boundary_facets(mesh.cells)
    assert len(boundary_loops(mesh.points, facets, "ring")) == 2
    with pytest.raises(MeshError, match="hole outside of everything"):
        triangulate([outer, hole + 5.0], 100)
    points = np.array([[0.0, 0], [-1, 1], [-1, -1], [1, -1], [1, 1]])  # a bow tie: two triangles share a vertex
    facets, _ = boundary_facets(np.array([[0, 1, 2], [0, 3, 4]]))
    with pytest.raises(MeshError, match="meets itself in a vertex"):
        boundary_loops(points, facets, "bow tie")
