"""Motions that contact holds back, and supports that are released, give the same result on one rank and on two."""

from pathlib import Path

import numpy as np
import pytest

from on_ranks import results_on

PROGRAM = Path(__file__).with_name("press_on_ranks.py")


@pytest.mark.mpi
def test_one_rank_and_two_are_held_back_alike(tmp_path):
    one, two = results_on((1, 2), tmp_path, PROGRAM)
    assert one["substeps"].max() > 1 and one["behind"].max() > 0.0
    # Parts end where detection says so: a step cut in many parts adds up differences of the linear solves.
    np.testing.assert_allclose(two["behind"], one["behind"], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-4 * 0.4)
