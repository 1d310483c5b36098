"""The tests cover each line of the module's table: the choice of the next projection and the length of steps. They also
check that retries end.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from pdvol.solve.iteration import (
    MAX_LENGTHENING,
    PAUSE,
    Projection,
    fraction_kept,
    lengthening,
)


def after(projection, kept, full=True, detects_indefinite=True):
    return projection.after(kept, full, detects_indefinite)


@pytest.mark.parametrize(
    "kept, mode",
    [(1.0, "clamp"), (0.6, "clamp"), (0.4, "abs"), (-0.1, "abs"), (1.5, "none")],
)
def test_the_actual_decrease_chooses_the_projection(kept, mode):
    assert after(Projection(), kept).mode == mode


@pytest.mark.parametrize("full, detects_indefinite", [(False, True), (True, False)])
def test_projected_after_a_cut_step_or_where_nothing_would_notice(full, detects_indefinite):
    assert after(Projection(), 2.0, full=full, detects_indefinite=detects_indefinite).mode == "clamp"


def test_an_indefinite_hessian_is_left_alone_for_a_while():
    projection, waits = Projection(), []
    for _ in range(4):
        steps = 0
        while projection.mode != "none":
            projection = after(projection, 2.0)
            steps += 1
        projection = projection.after_indefinite()
        assert projection.mode == "clamp" and projection.after_indefinite() is projection
        waits.append(steps)
    assert waits == [1, PAUSE, PAUSE, PAUSE]


def test_an_unprojected_hessian_that_promised_too_much_is_left_alone_as_an_indefinite_one():
    projection = after(after(Projection(), 2.0), 0.1)
    assert projection.mode == "abs"
    for _ in range(PAUSE - 1):
        projection = after(projection, 2.0)
        assert projection.mode == "clamp"
    assert after(projection, 2.0).mode == "none"


def test_rounding_counts_a_step_and_projects():
    projection = Projection(mode="none", steps=3).after_rounding()
    assert (projection.mode, projection.steps) == ("clamp", 4)


def test_the_strongest_projection_is_taken_once():
    strongest = Projection().strongest()
    assert strongest.mode == "abs"
    assert strongest.strongest() is strongest


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
    "stiffness, expected",
    [
        (0.1, 10.0),
        (0.4, 2.5),
        (0.6, 1.0),
        (1.0, 1.0),
        (0.01, MAX_LENGTHENING),
        (0.0, MAX_LENGTHENING),
        (-0.3, MAX_LENGTHENING),
    ],
)
def test_a_step_that_repeats_the_last_one_goes_to_the_end_of_the_series(share, stiffness, expected):
    """Where the potential has so much of the model's stiffness along d, the step after t d is (1 - t stiffness) d."""
    d = np.array([[1.0, -2.0], [0.5, 3.0]])
    left = 1.0 - share * stiffness
    if left <= 0.0:
        assert lengthening(left * d, d, share * d, lambda a: a) == 1.0
    else:
        np.testing.assert_allclose(lengthening(left * d, d, share * d, lambda a: a), expected)


def test_other_steps_keep_their_length():
    d, other = np.array([[1.0, 0.0]]), np.array([[0.0, 0.5]])
    assert lengthening(0.9 * d + other, d, d, lambda a: a) == 1.0
    assert lengthening(0.9 * d, d, 0.0 * d, lambda a: a) == 1.0
