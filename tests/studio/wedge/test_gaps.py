"""Distances of boundaries, against hand-derived ones and against brute force by sampling."""

import numpy as np
import pytest

import runs
from pdvol.studio.wedge.scored_body import segment_gaps, surface_gap


def test_segments_by_sampling():
    ends = np.random.default_rng(0).normal(size=(2, 60, 2, 3))
    ends[1, :10, 1] = ends[1, :10, 0] + 0.7 * (ends[0, :10, 1] - ends[0, :10, 0])  # parallel
    ends[1, 10:13, 1] = ends[1, 10:13, 0]  # a point
    t = np.linspace(0.0, 1.0, 401)[:, None]
    sampled = [
        np.linalg.norm((a[0] + t * (a[1] - a[0]))[:, None] - (b[0] + t * (b[1] - b[0]))[None], axis=2).min()
        for a, b in zip(*ends, strict=True)
    ]
    found = segment_gaps(*ends)
    assert (found <= np.array(sampled) + 1e-12).all() and np.abs(found - sampled).max() < 0.01


def test_crossed_edges_are_nearer_than_any_corner():
    one = np.array([[-1.0, 0, 0], [1, 0, 0], [0, 0, -1]])
    other = np.array([[0.0, -1, 0.25], [0, 1, 0.25], [0, 0, 1]])
    facet = np.array([[0, 1, 2]])
    assert surface_gap(one, facet, other, facet) == pytest.approx(0.25)


@pytest.mark.parametrize("dim", [2, 3])
def test_balls(dim):
    one, other = runs.ball(dim, 300, np.zeros(dim)), runs.ball(dim, 300, 1.5 * np.eye(dim)[0])
    gap = surface_gap(one.points, one.boundary, other.points, other.boundary)
    assert 0.5 <= gap < 0.55
    assert surface_gap(other.points, other.boundary, one.points, one.boundary) == pytest.approx(gap, rel=1e-12)
    near = one.points[np.unique(one.boundary)][:, None] - other.points[np.unique(other.boundary)][None]
    assert gap <= np.linalg.norm(near, axis=2).min()
