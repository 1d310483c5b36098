"""The rules on the last two iterations, as tables: when the matrix is kept, when a solve ends, which projection
comes next, and which steps are lengthened.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from pdvol.solve.iteration import (
    CANCELLATION,
    CONTRACTING,
    SAME_DIRECTION,
    SHORT,
    Iteration,
    fraction_kept,
    is_at_rounding,
    keeps_matrix,
    lengthening,
    next_projection,
    step_factor,
    stops,
)

TOLERANCE = 1e-3  # m/s
MOST = 1.0 / (1.0 - SAME_DIRECTION)


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


def test_the_actual_decrease_chooses_the_projection():
    """But after a cut step, and where nothing would notice an indefinite matrix."""
    for kept, mode in ((1.0, "clamp"), (0.6, "clamp"), (0.4, "abs"), (-0.1, "abs"), (1.5, "none")):
        assert next_projection(kept, full=True, detects_indefinite=True) == mode
    for full, detects in ((False, True), (True, False)):
        assert next_projection(2.0, full=full, detects_indefinite=detects) == "clamp"


def test_the_promise_is_the_quadratic_models():
    """Along d of a quadratic with slope -d'Hd: -(t - t^2 / 2) d'Hd, t the fraction taken."""
    d = np.array([[1.0, -2.0], [0.5, 3.0]])
    last = SimpleNamespace(start=SimpleNamespace(owned=np.ones_like(d)), direction=d, slope=-4.0, energy=7.0)
    for part in (0.1, 0.5, 1.0):
        end = SimpleNamespace(owned=1.0 + part * d)
        fell = 0.3 * 4.0 * (part - part**2 / 2)
        np.testing.assert_allclose(fraction_kept(last, end, 7.0 - fell, lambda a: a), 0.3)


@pytest.mark.parametrize("share", [0.3, 1.0, 4.0])
@pytest.mark.parametrize(
    "stiffness, expected", [(0.1, 10.0), (0.4, 2.5), (0.6, 1.0), (1.0, 1.0), (0.01, MOST), (0.0, MOST), (-0.3, MOST)]
)
def test_a_step_that_repeats_the_last_one_goes_to_the_end_of_the_series(share, stiffness, expected):
    """Where the potential has so much of the model's stiffness along d, the step after t d is (1 - t stiffness) d."""
    d = np.array([[1.0, -2.0], [0.5, 3.0]])
    left = 1.0 - share * stiffness
    if left <= 0.0:
        assert lengthening(left * d, d, share * d, lambda a: a) == 1.0
    else:
        np.testing.assert_allclose(lengthening(left * d, d, share * d, lambda a: a), expected)
    other = np.array([[2.0, 1.0], [0.0, 0.0]])  # across: others keep their length
    assert lengthening(0.9 * d + other, d, d, lambda a: a) == lengthening(0.9 * d, d, 0.0 * d, lambda a: a) == 1.0
