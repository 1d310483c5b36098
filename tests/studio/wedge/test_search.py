"""The search on functions whose highest point is known, with evaluations that fail among them."""

import numpy as np
import pytest

from pdvol.errors import InputError
from pdvol.studio.wedge.search import losses, seek

RANGES = {"speed": (0.0, 10.0), "spin": (-500.0, 500.0), "offset": (0.001, 0.002)}
TOP = {"speed": 7.0, "spin": -210.0, "offset": 0.0018}


def bowl(parameters):
    """0 at `TOP`, less elsewhere: minus the squared distance in ranges."""
    return -sum(((parameters[k] - TOP[k]) / (high - low)) ** 2 for k, (low, high) in RANGES.items())


def scored(variations):
    return [bowl(p) for p in variations]


def sought(evaluate, runs, seed, **options):
    """What a search has found at its end, and all variations that it evaluated."""
    asked = []

    def recorded(variations):
        asked.extend(variations)
        return evaluate(variations)

    *_, found = seek(recorded, RANGES, runs, 60.0, seed, **options)
    assert found.runs == len(asked) <= runs
    return found, asked


def test_finds_the_top_of_a_bowl():
    found, asked = sought(scored, 300, 0)
    assert found.runs == 300
    assert found.score > -1e-4 and found.score == bowl(asked[found.number])
    uniform = np.random.default_rng(0).uniform(*np.array(list(RANGES.values())).T, (300, 3))
    assert found.score > max(scored([dict(zip(RANGES, row, strict=True)) for row in uniform]))


def test_same_seed_same_search():
    (_, one), (_, other), (_, third) = (sought(scored, 60, seed) for seed in (3, 3, 4))
    assert one == other and one != third


def test_bounds_hold_and_are_reached():
    found, asked = sought(lambda variations: [p["speed"] for p in variations], 200, 1)
    assert all(low <= p[k] <= high for p in asked for k, (low, high) in RANGES.items())
    assert found.score == pytest.approx(10.0, abs=0.05)


def test_failing_evaluations_do_not_stop_it():
    def half(variations):
        return [bowl(p) if p["spin"] < 0.0 else float("nan") for p in variations]

    found, asked = sought(half, 300, 0)
    assert found.score > -1e-3 and asked[found.number]["spin"] < 0.0


def test_a_search_in_which_all_fail():
    found, _ = sought(lambda variations: [float("nan")] * len(variations), 40, 0)
    assert (found.number, found.runs) == (-1, 40) and np.isnan(found.score)


def test_the_bound_of_runs_cuts_the_last_batch():
    sizes = []

    def counted(variations):
        sizes.append(len(variations))
        return scored(variations)

    assert sought(counted, 21, 0, batch=8)[0].runs == 21
    assert sizes == [8, 8, 5]


def test_the_bound_of_time_ends_it(monkeypatch):
    from pdvol.studio.wedge import search

    now = [0.0]

    def slow(variations):
        now[0] += 5.0
        return scored(variations)

    monkeypatch.setattr(search.time, "monotonic", lambda: now[0])
    assert [found.runs for found in seek(slow, RANGES, 1000, 12.0, 0, batch=6)] == [6, 12, 18]


def test_a_goal_ends_it_and_the_best_only_rises():
    seen = list(seek(scored, RANGES, 1000, 60.0, 0, goal=-0.01))
    assert seen[-1].score >= -0.01 > seen[-2].score and seen[-1].runs < 1000
    assert all(a.score <= b.score and a.runs < b.runs for a, b in zip(seen, seen[1:], strict=False))


def test_a_flat_score_ends():
    assert sought(lambda variations: [1.0] * len(variations), 5000, 0)[0].number == 0


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
        list(seek(scored, ranges, runs, 1.0, 0))


def test_no_runs():
    with pytest.raises(InputError, match="runs = 0"):
        list(seek(scored, RANGES, 0, 1.0, 0))
