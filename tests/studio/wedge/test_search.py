"""The search on functions whose highest point is known, with evaluations that fail among them."""

import numpy as np
import pytest

from pdvol.errors import InputError
from pdvol.studio.wedge.search import Found, losses, seek

RANGES = {"speed": (0.0, 10.0), "spin": (-500.0, 500.0), "offset": (0.001, 0.002)}
TOP = {"speed": 7.0, "spin": -210.0, "offset": 0.0018}


def bowl(parameters):
    """0 at `TOP`, less elsewhere: minus the squared distance in ranges."""
    return -sum(((parameters[k] - TOP[k]) / (high - low)) ** 2 for k, (low, high) in RANGES.items())


def scored(variations):
    return [bowl(p) for p in variations]


def test_finds_the_top_of_a_bowl():
    found = seek(scored, RANGES, 300, 60.0, 0)
    assert found.runs == 300 and found.ended == "runs"
    assert found.score > -1e-4 and found.score == bowl(found.parameters)
    uniform = np.random.default_rng(0).uniform(*np.array(list(RANGES.values())).T, (300, 3))
    assert found.score > max(scored([dict(zip(RANGES, row, strict=True)) for row in uniform]))


def test_same_seed_same_search():
    one, other, third = (seek(scored, RANGES, 60, 60.0, seed) for seed in (3, 3, 4))
    assert (one.parameters, one.history) == (other.parameters, other.history)
    assert one.history != third.history


def test_bounds_hold_and_are_reached():
    asked = []

    def upper(variations):
        asked.extend(variations)
        return [p["speed"] for p in variations]

    found = seek(upper, RANGES, 200, 60.0, 1)
    assert all(low <= p[k] <= high for p in asked for k, (low, high) in RANGES.items())
    assert found.score == pytest.approx(10.0, abs=0.05)


def test_failing_evaluations_do_not_stop_it():
    def half(variations):
        return [bowl(p) if p["spin"] < 0.0 else float("nan") for p in variations]

    found = seek(half, RANGES, 300, 60.0, 0)
    assert found.score > -1e-3 and found.parameters["spin"] < 0.0


def test_a_search_in_which_all_fail():
    found = seek(lambda variations: [float("nan")] * len(variations), RANGES, 40, 60.0, 0)
    assert (found.parameters, found.number, found.runs) == ({}, -1, 40) and np.isnan(found.score)
    assert np.isnan(found.history).all()


def test_the_bound_of_runs_cuts_the_last_batch():
    sizes = []

    def counted(variations):
        sizes.append(len(variations))
        return scored(variations)

    found = seek(counted, RANGES, 21, 60.0, 0, batch=8)
    assert sizes == [8, 8, 5] and found.runs == 21 == len(found.history)


def test_the_bound_of_time_ends_it(monkeypatch):
    from pdvol.studio.wedge import search

    now = [0.0]

    def slow(variations):
        now[0] += 5.0
        return scored(variations)

    monkeypatch.setattr(search.time, "monotonic", lambda: now[0])
    found = seek(slow, RANGES, 1000, 12.0, 0, batch=6)
    assert (found.ended, found.runs, found.seconds) == ("seconds", 18, 15.0)


def test_a_goal_ends_it_and_reports_come_in_order():
    seen: list[Found] = []
    found = seek(scored, RANGES, 1000, 60.0, 0, seen.append, goal=-0.01)
    assert found.ended == "goal" and found.score >= -0.01 and found.runs < 1000
    assert seen[-1] == found and [f.runs for f in seen] == sorted(f.runs for f in seen)
    assert all(a.score <= b.score for a, b in zip(seen, seen[1:], strict=False))
    assert bowl(found.parameters) == found.history[found.number]


def test_a_flat_score_ends():
    assert seek(lambda variations: [1.0] * len(variations), RANGES, 5000, 60.0, 0).runs <= 5000


def test_failures_rank_last():
    assert losses([1.0, float("nan"), -3.0]) == [-1.0, 7.0, 3.0]
    assert losses([float("nan")] * 2) == [0.0, 0.0]
    values = losses([float("inf"), 2.0, -float("inf")])
    assert values == sorted(values) and len(set(values)) == 3


@pytest.mark.parametrize(
    ("ranges", "runs", "message"),
    [({}, 10, "needs parameters"), ({"x": (1.0, 1.0)}, 10, "varies x"), ({"x": (0.0, np.inf)}, 10, "varies x")],
)
def test_ranges_that_cannot_be_searched(ranges, runs, message):
    with pytest.raises(InputError, match=message):
        seek(scored, ranges, runs, 1.0, 0)


def test_no_runs():
    with pytest.raises(InputError, match="runs = 0"):
        seek(scored, RANGES, 0, 1.0, 0)
