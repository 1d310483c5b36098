"""Searches on the boundary of a body."""

import numpy as np
import pytest

from pdvol.geometry.boundary_search import BoundarySearch
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


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(5))
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
