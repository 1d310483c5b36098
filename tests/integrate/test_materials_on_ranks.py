"""The number of ranks changes neither what cells are made of nor what loads and damping do."""

from pathlib import Path

import numpy as np
import pytest

from on_ranks import results_on

PROGRAM = Path(__file__).with_name("materials_on_ranks.py")
SAME = 1e-9  # of the unit box, over five steps with the direct solver


@pytest.mark.mpi
@pytest.mark.parametrize("d", [2, 3])
def test_materials_and_loads_on_two_ranks(d, tmp_path):
    one, two = results_on((1, 2), tmp_path, PROGRAM, str(d))
    for name in ("young", "density", "law"):
        np.testing.assert_array_equal(one[name], two[name])
    assert set(one["law"]) == {0, 1, 2} and one["young"].max() == 1e9
    assert all(
        np.abs(one["energies"][:, list(one["kinds"]).index(kind)]).max() > 0.0
        for kind in ("elastic", "damping", "drag", "load")
    )
    assert np.abs(one["positions"][-1] - one["rest"]).max() > 1e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=SAME)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-9 * np.abs(one["energies"]).max())
