"""Which edges cross which triangles, by tests apart from the solver's."""

import numpy as np
import pytest

from pdvol import meshes
from pdvol.geometry.crossings import edges_of, find_crossings
from pdvol.geometry.level_mesh import boundary_facets
from pdvol.scene import Placement


@pytest.mark.parametrize(
    ("size", "far"), [(1.0, 0.0), (1.0, 3e3), (1.0, 6e3), (1.0, 1.2e4), (1.0, 1e6), (1e-3, 5.0), (1e-3, 1e3)]
)
def test_crossings_are_those_of_bodies_wherever_they_are(size, far):
    """Flat sides that round-off folds far from the origin cross nothing; an edge pushed through a side does."""
    brick = meshes.brick((size,) * 3, (3, 3, 3))
    faces = boundary_facets(brick.cells)[0]
    points = Placement((far, 0.0, 0.0), 0.3, (0.0, 1.0, 0.0))(brick.vertices)
    edges = edges_of(faces)
    assert len(find_crossings(points, edges, faces)) == 0
    middle = np.argmin(np.linalg.norm(points - points.mean(axis=0) - [0.0, 0.5 * size, 0.0], axis=1))
    points[middle, 1] -= 1.2 * size
    assert len(find_crossings(points, edges, faces)) > 0
