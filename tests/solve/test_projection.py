"""The tests cover each line of the module's table: the choice of the next projection and the length of steps."""

from types import SimpleNamespace

import numpy as np
import pytest

from pdvol.solve.iteration import SAME_DIRECTION, fraction_kept, lengthening, next_projection

MOST = 1.0 / (1.0 - SAME_DIRECTION)


@pytest.mark.parametrize("kept, mode", [(1.0, "clamp"), (0.6, "clamp"), (0.4, "abs"), (-0.1, "abs"), (1.5, "none")])
def test_the_actual_decrease_chooses_the_projection(kept, mode):
    assert next_projection(kept, full=True, detects_indefinite=True) == mode


@pytest.mark.parametrize("full, detects_indefinite", [(False, True), (True, False)])
def test_projected_after_a_cut_step_or_where_nothing_would_notice(full, detects_indefinite):
    assert next_projection(2.0, full=full, detects_indefinite=detects_indefinite) == "clamp"


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


def test_other_steps_keep_their_length():
    d, other = np.array([[1.0, 0.0]]), np.array([[0.0, 0.5]])
    assert lengthening(0.9 * d + other, d, d, lambda a: a) == 1.0
    assert lengthening(0.9 * d, d, 0.0 * d, lambda a: a) == 1.0
