"""Principal stretches and strain by vertex, against values by hand."""

import numpy as np
import pytest

import shapes
from pdvol.geometry.level_mesh import principal_stretches, vertex_strain


@pytest.mark.parametrize("dim", [2, 3])
def test_an_affine_motion_stretches_every_cell_alike(dim):
    mesh = shapes.box(dim, 2)
    stretches = np.array([1.1, 0.7, 1.25][:dim])
    turns = [np.linalg.qr(np.random.default_rng(seed).standard_normal((dim, dim)))[0] for seed in (0, 1)]
    moved = mesh.points @ (turns[0] * stretches @ turns[1]) + 3.0
    expected = np.sort(stretches)[::-1]
    np.testing.assert_allclose(principal_stretches(mesh, moved), np.tile(expected, (len(mesh.cells), 1)), rtol=1e-9)
    np.testing.assert_allclose(vertex_strain(mesh, moved), 0.3, rtol=1e-9)
    np.testing.assert_allclose(vertex_strain(mesh, mesh.points @ turns[0]), 0.0, atol=1e-12)


def test_strain_of_a_vertex_is_the_mean_over_the_volumes_about_it():
    """Two triangles of areas 0.5 and 1 share an edge on the y axis; the first becomes twice as wide, the other half."""
    mesh = shapes.level(np.array([[0.0, 0], [1, 0], [0, 1], [-2, 0]]), [[0, 1, 2], [0, 2, 3]])
    moved = mesh.points * [[1, 1], [2, 1], [1, 1], [0.5, 1]]
    shared = (0.5 * 1.0 + 1.0 * 0.5) / 1.5
    np.testing.assert_allclose(vertex_strain(mesh, moved), [shared, 1.0, shared, 0.5], rtol=1e-12)
