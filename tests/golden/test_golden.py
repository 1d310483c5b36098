"""Four short shots end as they were recorded, to the solver's tolerance."""

import golden
import numpy as np
import pytest

# Relative to the scene's diagonal. Newton stops at 1e-5 diagonals/s, so at 1e-7 diagonals a step of 0.01 s; other
# rounding moves that by up to as much in each of 40 steps.
TOLERANCE = 4e-6
# The finer level of the drop has two ends, 1.5e-4 apart. A change of the initial velocity by 1e-13 m/s decides.
TOLERANCE_OF_DROP = 4e-4


@pytest.mark.mpi
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow) if name == "drop_on_two_ranks" else name for name in golden.RUNS],
)
def test_golden_run_repeats(name, tmp_path):
    run = golden.simulate(name, tmp_path / name)
    tolerance = TOLERANCE_OF_DROP if "drop" in name else TOLERANCE
    stored = np.load(golden.HERE / "last_states.npz")
    for key, positions in golden.last_states(run).items():
        np.testing.assert_allclose(positions, stored[f"{name}_{key}"], rtol=0.0, atol=tolerance * run.info["diagonal"])
