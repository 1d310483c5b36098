"""The search on functions whose highest point is known, with evaluations that fail among them."""

import numpy as np
import pytest

from pdvol.studio.wedge import search
from pdvol.studio.wedge.search import losses, seek
from pdvol.studio.wedge.vary import parsed_varies

TOP = np.array([0.7, 0.29, 0.8])


def bowl(point):
    """0 at `TOP`, less elsewhere: minus the squared distance."""
    return -float(((point - TOP) ** 2).sum())


def sought(score, runs, seed, batch=search.BATCH, **options):
    """The points that a search has evaluated, batch by batch, and their scores."""
    batches = []

    def evaluate(points):
        batches.append([(point, score(point)) for point in points])
        return [value for _, value in batches[-1]]

    seek(evaluate, 3, search.Until(runs, **{"deadline": np.inf, **options}), seed, batch)
    points, scores = (np.array(part) for part in zip(*sum(batches, []), strict=True))
    assert len(points) <= runs and (points >= 0.0).all() and (points <= 1.0).all()
    return points, scores, [len(batch) for batch in batches]


def test_finds_the_top_of_a_bowl_and_the_same_with_the_same_seed():
    points, scores, _ = sought(bowl, 300, 0)
    assert len(points) == 300 and scores.max() > -1e-4
    assert scores.max() > max(map(bowl, np.random.default_rng(0).random((300, 3))))
    one, other, third = (sought(bowl, 60, seed)[0] for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, other)
    assert (one != third).any() and np.isnan(sought(lambda point: np.nan, 40, 0)[1]).all(), "it ends where all fail"


@pytest.mark.parametrize(
    ("score", "runs", "seed", "least"),
    [
        (lambda point: point[0], 200, 1, 0.995),  # the bound is reached
        (lambda point: bowl(point) if point[1] < 0.5 else np.nan, 300, 0, -1e-3),  # half of them fail
        (lambda point: 1.0, 5000, 0, 1.0),  # flat
    ],
)
def test_bounds_failures_and_flat_scores(score, runs, seed, least):
    assert np.nanmax(sought(score, runs, seed)[1]) >= least


def test_what_ends_a_search(monkeypatch):
    assert sought(bowl, 21, 0, batch=8)[2] == [8, 8, 5], "the number of runs"
    _, scores, sizes = sought(bowl, 1000, 0, goal=-0.01)
    assert scores[-sizes[-1] :].max() >= -0.01 > scores[: -sizes[-1]].max(), "the goal"
    now = [0.0]

    def slow(point):
        now[0] += 5.0 / 6
        return bowl(point)

    monkeypatch.setattr(search.time, "monotonic", lambda: now[0])
    assert sought(slow, 1000, 0, deadline=12.0)[2] == [6, 6, 6], "the time"


def test_failures_rank_last():
    assert losses([1.0, float("nan"), -3.0]) == [-1.0, 7.0, 3.0]
    assert losses([float("nan")] * 2) == [0.0, 0.0]
    values = losses([float("inf"), 2.0, -float("inf")])
    assert values == sorted(values) and len(set(values)) == 3


@pytest.mark.parametrize("words", [(), ("a=1,2",), ("a=1:1",)])
def test_a_search_needs_ranges(words):
    with pytest.raises(search.InputError, match="--seek needs ranges"):
        search.seek_best(None, "s", parsed_varies(words), None, search.Until(1, 0.0), 0, print)
