"""The number of ranks does not change the motion."""

from pathlib import Path

import numpy as np
import pytest
from fall_on_ranks import SIZE, STEPS

from on_ranks import results_on

PROGRAM = Path(__file__).with_name("fall_on_ranks.py")
SAME = 1e-6  # of the scene's size, over the first 20 steps with the direct solver


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("d", "ranks", "integrator"),
    [
        (2, 2, "implicit_euler"),
        (3, 2, "implicit_euler"),
        (2, 3, "implicit_euler"),
        (2, 2, "bdf2"),
        pytest.param(3, 4, "implicit_euler", marks=pytest.mark.slow),  # more ranks than two: in 2D; 3D: on two
    ],
)
def test_one_rank_and_more_agree(d, ranks, integrator, tmp_path):
    one, more = results_on((1, ranks), tmp_path, PROGRAM, str(d), integrator)
    assert more["owned"].min() > 0
    assert one["positions"].shape[0] == STEPS
    np.testing.assert_array_equal(one["cuts"], 0)  # a cut step on one side only would be another motion
    assert one["contacts"].max() > 2
    kinds = list(one["kinds"])
    assert all(one["energies"][:, kinds.index(kind)].max() > 0.0 for kind in ("barrier", "friction"))
    np.testing.assert_allclose(more["positions"], one["positions"], rtol=0.0, atol=SAME * SIZE)
    np.testing.assert_allclose(more["energies"], one["energies"], rtol=1e-3, atol=1e-6 * np.abs(one["energies"]).max())
    np.testing.assert_allclose(more["residuals"], one["residuals"], rtol=1e-2, atol=1e-4)
    np.testing.assert_allclose(more["kappas"], one["kappas"], rtol=1e-4)
    assert one["residuals"].max() > 0.0
