"""Products and solves are the same on any number of ranks."""

from pathlib import Path

import numpy as np
import pytest

from on_ranks import results_on

PROGRAM = Path(__file__).with_name("linear_on_ranks.py")


@pytest.mark.mpi
@pytest.mark.parametrize("d, ranks", [(2, 2), (3, 2), pytest.param(3, 3, marks=pytest.mark.slow)])
def test_one_rank_and_more_agree(d, ranks, tmp_path):
    one, more = results_on((1, ranks), tmp_path, PROGRAM, str(d))
    for pairs in (True, False):
        product, direct = one[f"product {pairs}"], one[f"direct {pairs}"]
        np.testing.assert_allclose(more[f"product {pairs}"], product, rtol=0.0, atol=1e-12 * np.abs(product).max())
        for results in (one, more):
            for method in ("iterative", "multilevel", "direct"):
                found = results[f"{method} {pairs}"]
                np.testing.assert_allclose(found, direct, rtol=0.0, atol=1e-7 * np.abs(direct).max())
