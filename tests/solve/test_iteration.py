"""The rules on the last two iterations, as tables: when the matrix is kept, when a solve ends, which steps are
lengthened.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from pdvol.solve.iteration import (
    CANCELLATION,
    CONTRACTING,
    OLD_MATRIX_TOLERANCE,
    OPENING,
    ROUNDING,
    SHORT,
    STALLED,
    UNSETTLED,
    Iteration,
    Projection,
    is_at_rounding,
    is_calm,
    is_short,
    keeps_matrix,
    opens,
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
        "projection": Projection(),
        "matrix_age": 0,
        "at_rounding": False,
        "lengthening": 1.0,
        "cap": 1.0,
        "gap": np.inf,
    }
    return Iteration(**{**record, **changes})


FAST = iteration(100 * TOLERANCE)


@pytest.mark.parametrize(
    "changes, calm",
    [
        ({}, True),
        ({"cap": 0.9}, False),
        ({"backtracks": 1}, False),
        ({"opened": True}, False),
        ({"speed": SHORT * TOLERANCE}, True),
        ({"speed": 1.01 * SHORT * TOLERANCE}, False),
    ],
)
def test_calm_steps_are_full_short_and_stay_in_the_barrier(changes, calm):
    assert is_calm(iteration(**changes), TOLERANCE) is calm


@pytest.mark.parametrize(
    "last, before, kept",
    [
        (None, None, False),
        (FAST, None, False),
        (iteration(), None, True),
        (iteration(), FAST, True),
        (iteration(at_rounding=True), FAST, False),
        (iteration(opened=True), FAST, False),
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
        (iteration(opened=True), FAST, ""),
        (iteration(softer=True), FAST, ""),
        (iteration(), iteration(100 * TOLERANCE, cap=0.5), ""),
        (iteration(), iteration(0.9 * TOLERANCE), ""),
        (iteration(matrix_age=1), FAST, ""),
        (iteration(OLD_MATRIX_TOLERANCE * TOLERANCE, matrix_age=1), FAST, "TOLERANCE"),
        (iteration(cap=0.5, at_rounding=True), FAST, "TOLERANCE"),
        (iteration(2 * TOLERANCE, at_rounding=True), iteration(2 * TOLERANCE / STALLED), ""),
        (iteration(2.01 * TOLERANCE, at_rounding=True), iteration(2 * TOLERANCE / STALLED), "ROUNDING"),
    ],
)
def test_a_solve_ends_after_a_settled_step_below_the_tolerance_or_at_round_off(last, before, why):
    assert stops(last, before, TOLERANCE) == why


def test_round_off_is_relative_to_the_energy_and_to_what_cancels_in_it():
    assert is_at_rounding(-0.9 * ROUNDING * 5.0, -5.0, 0.0) and not is_at_rounding(-1.1 * ROUNDING * 5.0, -5.0, 0.0)
    assert is_at_rounding(-0.9 * CANCELLATION, 0.0, 1.0) and not is_at_rounding(-1.1 * CANCELLATION, 0.0, 1.0)


def test_short_and_opening_steps():
    assert is_short(SHORT * TOLERANCE, TOLERANCE) and not is_short(1.01 * SHORT * TOLERANCE, TOLERANCE)
    assert opens(1.0, 1.01 * OPENING) and not opens(1.0, OPENING) and not opens(np.inf, np.inf)


@pytest.mark.parametrize(
    "changes, last, factor",
    [
        ({}, iteration(), 10.0),
        ({}, None, 1.0),
        ({}, iteration(projection=Projection(mode="none")), 1.0),
        ({"projection": Projection(mode="none")}, iteration(), 1.0),
        ({"at_rounding": True}, iteration(), 1.0),
        ({"speed": 1.01 * UNSETTLED * TOLERANCE}, iteration(), 1.0),
    ],
)
def test_only_settled_steps_by_projected_hessians_are_lengthened(changes, last, factor):
    """The step repeats nine tenths of the last one: the potential has a tenth of the model's stiffness."""
    arguments = {
        "start": SimpleNamespace(owned=np.ones((2, 2))),
        "direction": 0.9 * np.ones((2, 2)),
        "speed": TOLERANCE,
        "at_rounding": False,
        "projection": Projection(),
        **changes,
    }
    assert step_factor(**arguments, last=last, tolerance=TOLERANCE, total=lambda a: a) == pytest.approx(factor)
