"""Which Hessian is taken next: each line of the table, and that retries end."""

import numpy as np
import pytest

from pdvol.solve.globalization import LONGEST, PAUSE, STUCK, ModelChoice, lengthening, promised_decrease


@pytest.mark.parametrize(
    "came, positive, quick",
    [(-1.0, "clamp", True), (-0.6, "clamp", True), (-0.4, "abs", False), (0.1, "abs", False), (-1.5, "none", True)],
)
def test_by_what_came_of_a_promise(came, positive, quick):
    model = ModelChoice()
    model.took(-1.0, came, whole=True, cap=1.0, may_be_raw=True)
    assert (model.positive, model.quick) == (positive, quick)


@pytest.mark.parametrize("whole, may_be_raw", [(False, True), (True, False)])
def test_not_raw_after_a_cut_step_or_where_nothing_would_notice(whole, may_be_raw):
    model = ModelChoice()
    model.took(-1.0, -2.0, whole=whole, cap=1.0, may_be_raw=may_be_raw)
    assert model.positive == "clamp"


def test_short_cuts_are_given_up_for_good():
    """After one bad promise, or steps that contact keeps cutting short."""
    model = ModelChoice()
    for _ in range(STUCK):
        assert model.quick
        model.took(-1.0, -1.0, whole=False, cap=0.01, may_be_raw=True)
    assert not model.quick and model.positive == "clamp"
    model.took(-1.0, -1.0, whole=True, cap=1.0, may_be_raw=True)
    assert not model.quick


def test_an_indefinite_hessian_is_left_alone_for_longer_each_time():
    model = ModelChoice()
    waits = []
    for _ in range(4):
        steps = 0
        while model.positive != "none":
            model.took(-1.0, -2.0, whole=True, cap=1.0, may_be_raw=True)
            steps += 1
        assert model.was_indefinite()
        assert model.positive == "clamp" and not model.was_indefinite()
        waits.append(steps)
    assert waits == [1, *(PAUSE * 2**k for k in (1, 2, 3))]


def test_an_unfiltered_hessian_that_promised_too_much_is_left_alone_as_one_that_is_indefinite():
    model = ModelChoice()
    model.took(-1.0, -2.0, whole=True, cap=1.0, may_be_raw=True)
    model.took(-1.0, -0.1, whole=True, cap=1.0, may_be_raw=True)
    assert model.positive == "abs"
    for _ in range(2 * PAUSE - 1):
        model.took(-1.0, -2.0, whole=True, cap=1.0, may_be_raw=True)
        assert model.positive == "clamp"
    model.took(-1.0, -2.0, whole=True, cap=1.0, may_be_raw=True)
    assert model.positive == "none"


def test_care_is_taken_once():
    model = ModelChoice()
    assert model.be_careful()
    assert (model.positive, model.quick) == ("abs", False)
    assert not model.be_careful()


def test_the_promise_is_the_quadratic_models():
    """Along d of a quadratic with slope -d'Hd: -(t - t^2 / 2) d'Hd, t the share taken."""
    d = np.array([[1.0, -2.0], [0.5, 3.0]])
    for share in (0.1, 0.5, 1.0):
        np.testing.assert_allclose(promised_decrease(-4.0, share * d, d, lambda a: a), -4.0 * (share - share**2 / 2))


@pytest.mark.parametrize("share", [0.3, 1.0, 4.0])
@pytest.mark.parametrize(
    "stiffness, expected",
    [(0.1, 10.0), (0.4, 2.5), (0.6, 1.0), (1.0, 1.0), (0.01, LONGEST), (0.0, LONGEST), (-0.3, LONGEST)],
)
def test_a_step_that_repeats_the_last_one_goes_to_the_end_of_the_series(share, stiffness, expected):
    """Where the truth has so much of the model's stiffness along d, the step after t d is (1 - t stiffness) d."""
    d = np.array([[1.0, -2.0], [0.5, 3.0]])
    left = 1.0 - share * stiffness
    if left <= 0.0:
        assert lengthening(left * d, d, share * d, lambda a: a) == 1.0
    else:
        np.testing.assert_allclose(lengthening(left * d, d, share * d, lambda a: a), expected)


def test_other_steps_are_left_as_they_are():
    d, other = np.array([[1.0, 0.0]]), np.array([[0.0, 0.5]])
    assert lengthening(0.9 * d + other, d, d, lambda a: a) == 1.0
    assert lengthening(0.9 * d, d, 0.0 * d, lambda a: a) == 1.0
