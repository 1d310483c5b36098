"""The number of ranks does not change the motion."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fall_on_ranks import SIZE, STEPS

# Ranks give way while they wait, or a busy machine spends its time on their spinning; mpirun ends them itself when it takes too long.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1", "MPIEXEC_TIMEOUT": "100",
               "OMPI_MCA_rmaps_base_oversubscribe": "1", "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe"}
SAME = 1e-6  # of the scene's size, over the first 20 steps with the direct solver


@pytest.mark.mpi
@pytest.mark.parametrize(("d", "ranks", "law"), [
    (2, 2, "convergent"), (3, 2, "convergent"), (2, 3, "classic"), pytest.param(3, 2, "semi-implicit", marks=pytest.mark.slow), (3, 4, "convergent"),
])
def test_one_rank_and_more_agree(d, ranks, law, tmp_path):
    mpirun = shutil.which("mpirun")
    if mpirun is None:
        pytest.skip("there is no mpirun")
    results = []
    for count in (1, ranks):
        out = tmp_path / f"{count}.npz"
        command = [sys.executable, str(Path(__file__).with_name("fall_on_ranks.py")), str(d), law, str(out)]
        command = command if count == 1 else [mpirun, "-n", str(count), *command]
        done = subprocess.run(command, env={**os.environ, **ENVIRONMENT}, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        results.append(np.load(out))
    one, more = results
    assert (int(one["ranks"]), int(more["ranks"])) == (1, ranks)
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
