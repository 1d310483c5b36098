"""The front, fitted orders and candidates, on made-up costs and errors."""

import itertools

import numpy as np
import pytest

from pdvol.studio.study.front import (
    candidates,
    cheapest_within,
    fitted_order,
    most_accurate_within,
    on_front,
    richardson,
)


def test_the_front_holds_what_no_other_point_beats():
    costs, errors = np.random.default_rng(1).uniform(size=(2, 60))
    kept = on_front(costs, errors)
    beaten = [(costs <= c).astype(int) @ (errors <= e) > 1 for c, e in zip(costs, errors, strict=True)]
    assert 0 < sum(kept) < 60 and [not b for b in beaten] == kept
    assert on_front([1.0, 1.0, 2.0], [3.0, 3.0, 3.0]) == [True, True, False]


def test_an_order_is_found_from_differences_to_the_finest_result():
    """None is seen in two differences, which any order fits, or in none."""
    h = np.array([0.1, 0.2, 0.4, 0.8])
    for order in (0.5, 1.0, 2.0, 3.3):
        results = 7.0 + 0.3 * h**order
        assert fitted_order(h[1:], abs(results[1:] - results[0]), h[0]) == pytest.approx(order, rel=1e-4)
        assert richardson(abs(results[1] - results[0]), 2.0, order) == pytest.approx(0.3 * h[0] ** order)
    for steps, differences in (([0.2, 0.4], [0.1, 0.3]), (h[1:], [0.0, 0.1, 0.2]), (h[1:], [1.0, 1.0, 1.0])):
        assert fitted_order(steps, differences, 0.1) is None


def point(cost, error, outcome=True):
    return {"cost": {"cpu": cost}, "errors": {"end": error, "outcome": outcome}}


def test_the_choice_counts_the_reference_s_own_error_and_the_outcome():
    points = [point(1.0, 0.5), point(2.0, 0.2), point(3.0, 0.01, outcome=False), point(4.0, 0.05)]
    assert cheapest_within(points, 0.25, 0.0) is points[1]
    assert cheapest_within(points, 0.25, 0.1) is points[3]
    assert cheapest_within(points, 0.01, 0.0) is None
    assert most_accurate_within(points, 3.5) is points[1] and most_accurate_within(points, 0.5) is None


def test_candidates_are_the_front_of_a_scene_whose_costs_multiply_and_errors_add():
    """Cost c0 a b, squared errors the sum of what each axis adds: the best combinations are found first."""
    factors = {"dt": {2.0: (0.5, 0.3), 0.5: (2.0, 0.075)}, "tolerance": {10.0: (0.7, 0.02), 0.1: (1.5, 1e-4)}}
    dt0, tolerance0 = 0.15, 0.002

    def at(dt=None, tolerance=None):
        a, e = factors["dt"].get(dt, (1.0, dt0))
        b, f = factors["tolerance"].get(tolerance, (1.0, tolerance0))
        return 10.0 * a * b, float(np.hypot(e, f))

    axes = {"dt": {v: at(dt=v) for v in (2.0, 0.5)}, "tolerance": {v: at(tolerance=v) for v in (10.0, 0.1)}}
    measured = [at(), *axes["dt"].values(), *axes["tolerance"].values()]
    found = candidates(at(), axes, measured)
    every = [at(*pair) for pair in itertools.product((2.0, 0.5), (10.0, 0.1))]
    assert found and all(any(np.isclose(cost, c) for c, _ in every) for cost, _ in found)
    best = {"dt": 0.5, "tolerance": 10.0}
    assert best in [changes for _, changes in found]
    cost = next(cost for cost, changes in found if changes == best)
    assert cost == pytest.approx(at(0.5, 10.0)[0])
