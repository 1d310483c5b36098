"""Principal stretches and strain by vertex, against values by hand; facets and large levels against plain code."""

import numpy as np
import pytest

import shapes
from pdvol.geometry import level_mesh
from pdvol.geometry.level_mesh import boundary_facets, principal_stretches, simplex_volumes, vertex_strain
from pdvol.solve.linear import coarse_space
from pdvol.solve.linear.coarse_space import grid_weights


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


@pytest.mark.parametrize("dim", [2, 3])
def test_parts_of_a_large_level_have_the_values_of_the_whole(dim, monkeypatch):
    """A level of more cells and points than are looked at together, here 7, gets the same volumes and weights."""
    mesh = shapes.box(dim, 3, jitter=0.1, seed=2)
    assert min(len(mesh.cells), len(mesh.points)) > 14
    whole = simplex_volumes(mesh.points, mesh.cells), grid_weights(mesh).toarray()
    monkeypatch.setattr(level_mesh, "CELLS_AT_ONCE", 7)
    monkeypatch.setattr(coarse_space, "POINTS_AT_ONCE", 7)
    np.testing.assert_array_equal(simplex_volumes(mesh.points, mesh.cells), whole[0])
    np.testing.assert_array_equal(grid_weights(mesh).toarray(), whole[1])


@pytest.mark.parametrize("dim", [2, 3])
def test_facets_of_a_shuffled_mesh_are_found_by_their_vertices(dim):
    """Against a count of each facet's vertices as a set, on a mesh whose vertices and corners have a random order."""
    mesh, random = shapes.box(dim, 3), np.random.default_rng(5)
    order = random.permutation(len(mesh.points))
    cells = random.permuted(order[mesh.cells], axis=1)
    owners: dict[frozenset, list[int]] = {}
    for cell, corners in enumerate(cells.tolist()):
        for corner in corners:
            owners.setdefault(frozenset(corners) - {corner}, []).append(cell)
    facets, of = boundary_facets(cells)
    alone = {facet: found[0] for facet, found in owners.items() if len(found) == 1}
    assert {frozenset(facet): cell for facet, cell in zip(facets.tolist(), of.tolist(), strict=True)} == alone
    pairs, _ = shapes.level(mesh.points[np.argsort(order)], cells).inner_facets
    assert sorted(map(sorted, pairs.tolist())) == sorted(sorted(found) for found in owners.values() if len(found) == 2)
