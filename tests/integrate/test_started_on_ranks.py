"""Bodies that start bent move alike on one rank and on two."""

from pathlib import Path

import numpy as np
import pytest

from on_ranks import results_on

PROGRAM = Path(__file__).with_name("started_on_ranks.py")


@pytest.mark.mpi
def test_one_rank_and_two_move_alike(tmp_path):
    one, two = results_on((1, 2), tmp_path, PROGRAM)
    assert np.abs(one["energies"][-1]).min() > 0.0
    assert np.abs(one["positions"][-1] - one["positions"][0]).max() > 5e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-6)
