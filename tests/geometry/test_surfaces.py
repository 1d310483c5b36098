"""Searches on the boundaries of bodies, crossings of edges and triangles, and signed distances from closed surfaces, by
tests apart from the solver's, by brute force and by hand.
"""

import numpy as np
import pytest
import trimesh

from pdvol import meshes
from pdvol.geometry.boundary_search import BoundarySearch
from pdvol.geometry.crossings import edges_of, find_crossings
from pdvol.geometry.distances import deepest_inside, is_closed, signed_distance
from pdvol.geometry.level_mesh import boundary_facets
from pdvol.scene import Placement
from shapes import box, level


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e3])
def test_first_hits_agree_with_brute_force(d, scale):
    rng = np.random.default_rng(1)
    mesh = box(d, 3, jitter=0.2)
    mesh = level(mesh.points * scale, mesh.cells)
    starts, ends = (rng.uniform(-0.5, 1.5, (2, 400, d))) * scale
    facet, distance = BoundarySearch(mesh, 0).first_hits(starts, ends)
    corners = mesh.points[mesh.boundary]
    for start, end, found, reach in zip(starts, ends, facet, distance, strict=True):
        columns = [np.broadcast_to(start - end, (len(corners), d))] + [
            corners[:, k] - corners[:, 0] for k in range(1, d)
        ]
        solution = np.linalg.solve(np.stack(columns, axis=-1), (start - corners[:, 0])[..., None])[..., 0]
        t, uv = solution[:, 0], solution[:, 1:]
        t = np.where((t >= 0) & (t <= 1) & (uv >= 0).all(axis=1) & (uv.sum(axis=1) <= 1), t, np.inf)
        assert (found >= 0) == np.isfinite(t.min())
        if found >= 0:
            assert found == t.argmin()
            np.testing.assert_allclose(reach, t.min() * np.linalg.norm(end - start), rtol=1e-9)


@pytest.mark.parametrize(("d", "seed"), [(2, 0), (2, 1), (3, 2), (3, 3)])
def test_the_closest_facet_does_not_depend_on_the_order_of_cells(d, seed):
    """Near corners of a box with jittered vertices, where all facets of a corner are equally close."""
    rng = np.random.default_rng(seed)
    mesh = box(d, 2, jitter=0.2)
    cells = rng.permuted(mesh.cells[rng.permutation(len(mesh.cells))], axis=1)
    size = np.sign(np.linalg.det(mesh.points[cells[:, 1:]] - mesh.points[cells[:, :1]]))
    cells[size < 0, :2] = cells[size < 0, 1::-1]
    points = mesh.points.mean(axis=0) + rng.uniform(0.9, 1.2, (20, d)) * rng.choice([-1.0, 1.0], (20, d))
    found = [
        [set(each.boundary[search.closest_of(point, range(len(search.cells)))].tolist()) for point in points]
        for each in (mesh, level(mesh.points, cells))
        for search in [BoundarySearch(each, 0)]
    ]
    assert found[0] == found[1]


@pytest.mark.parametrize(("size", "far"), [(1.0, 0.0), (1.0, 6e3), (1.0, 1e6), (1e-3, 5.0), (1e-3, 1e3)])
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


@pytest.mark.parametrize("turned", [False, True])
def test_a_box_whichever_way_its_triangles_point(turned):
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    faces = cube.faces[:, ::-1] if turned else cube.faces
    points = np.array([[0.0, 0, 0], [0.9, 0, 0], [1.5, 0, 0], [2.0, 2.0, 1.0], [0.3, -0.8, 0.1]])
    found = signed_distance(points, cube.vertices, faces)
    np.testing.assert_allclose(found, [-1.0, -0.1, 0.5, np.sqrt(2.0), -0.2], atol=1e-12)
    assert deepest_inside(points[1:], cube.vertices, faces) == pytest.approx(0.2, abs=1e-12)
    assert deepest_inside(points[2:4], cube.vertices, faces) == 0.0
    assert deepest_inside(points[:0], cube.vertices, faces) == 0.0


def test_random_points_about_a_ball():
    ball = trimesh.creation.icosphere(4)
    points = np.random.default_rng(0).normal(size=(500, 3))
    found = signed_distance(points, ball.vertices, ball.faces)
    np.testing.assert_allclose(found, np.linalg.norm(points, axis=1) - 1.0, atol=3e-3)
    assert is_closed(ball.faces) and not is_closed(ball.faces[1:]) and not is_closed(ball.faces[:0])
