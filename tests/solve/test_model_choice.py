"""Which Hessian is taken next: each line of the table, and that retries end."""

import numpy as np
import pytest

from pdvol.solve.model_choice import PAUSE, STUCK, ModelChoice, promised_decrease


@pytest.mark.parametrize("came, positive, quick", [(-1.0, "clamp", True), (-0.6, "clamp", True), (-0.4, "abs", False), (0.1, "abs", False),
                                                   (-1.5, "none", True)])
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
    for k in range(STUCK):
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
