"""The rules on the last two iterations, as tables: when the matrix is kept, when a solve ends, which steps are
lengthened.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from pdvol.solve.iteration import (
    CANCELLATION,
    CONTRACTING,
    SHORT,
    Iteration,
    is_at_rounding,
    keeps_matrix,
    step_factor,
    stops,
)

TOLERANCE = 1e-3  # m/s


def iteration(speed=TOLERANCE, **changes) -> Iteration:
    """A full step of this speed by a new matrix."""
    record = {
        "start": SimpleNamespace(owned=np.zeros((2, 2))),
        "energy": 1.0,
        "direction": np.ones((2, 2)),
        "slope": -1.0,
        "speed": speed,
        "projection": "clamp",
        "matrix_age": 0,
        "at_rounding": False,
        "lengthening": 1.0,
        "cap": 1.0,
        "as_promised": True,
    }
    return Iteration(**{**record, **changes})


FAST = iteration(100 * TOLERANCE)


@pytest.mark.parametrize(
    "last, before, kept",
    [
        (None, None, False),
        (FAST, None, False),
        (iteration(), None, True),
        (iteration(), FAST, True),
        (iteration(at_rounding=True), FAST, False),
        (iteration(as_promised=False), FAST, False),
        (iteration(cap=0.9), FAST, False),
        (iteration(backtracks=1), FAST, False),
        (iteration(SHORT * TOLERANCE), FAST, True),
        (iteration(1.01 * SHORT * TOLERANCE), FAST, False),
        (iteration(CONTRACTING * TOLERANCE, matrix_age=1), iteration(TOLERANCE), True),
        (iteration(1.01 * CONTRACTING * TOLERANCE, matrix_age=1), iteration(TOLERANCE), False),
    ],
)
def test_the_matrix_is_kept_near_the_minimum(last, before, kept):
    assert keeps_matrix(last, before, TOLERANCE) is kept


@pytest.mark.parametrize(
    "last, before, why",
    [
        (iteration(), FAST, "TOLERANCE"),
        (iteration(), None, "TOLERANCE"),
        (iteration(1.01 * TOLERANCE), FAST, ""),
        (iteration(cap=0.5), FAST, ""),
        (iteration(backtracks=1), FAST, ""),
        (iteration(meets=True), FAST, ""),
        (iteration(matrix_age=1), FAST, "TOLERANCE"),
        (iteration(cap=0.5, at_rounding=True), FAST, "TOLERANCE"),
        (iteration(2 * TOLERANCE, at_rounding=True), iteration(2 * TOLERANCE / CONTRACTING), ""),
        (iteration(2.01 * TOLERANCE, at_rounding=True), iteration(2 * TOLERANCE / CONTRACTING), "ROUNDING"),
    ],
)
def test_a_solve_may_end_after_a_full_step_below_the_tolerance_or_at_round_off(last, before, why):
    assert stops(last, before, TOLERANCE) == why


def test_round_off_is_relative_to_what_cancels_in_the_energy():
    assert is_at_rounding(-0.9 * CANCELLATION, 1.0) and not is_at_rounding(-1.1 * CANCELLATION, 1.0)


@pytest.mark.parametrize(
    "changes, last, factor",
    [
        ({}, iteration(), 10.0),
        ({}, None, 1.0),
        ({}, iteration(projection="none"), 1.0),
        ({"projection": "none"}, iteration(), 1.0),
        ({}, iteration(meets=True), 1.0),
    ],
)
def test_only_steps_by_projected_hessians_are_lengthened(changes, last, factor):
    """The step repeats nine tenths of the last one: the potential has a tenth of the model's stiffness."""
    arguments = {
        "start": SimpleNamespace(owned=np.ones((2, 2))),
        "direction": 0.9 * np.ones((2, 2)),
        "projection": "clamp",
        **changes,
    }
    assert step_factor(**arguments, last=last, total=lambda a: a) == pytest.approx(factor)
