"""One rank and two give the same motion."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fall_on_ranks import SIZE, STEPS

# Ranks give way while they wait, or a busy machine spends its time on their spinning; mpirun ends them itself when it takes too long.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1", "MPIEXEC_TIMEOUT": "100"}
SAME = 1e-6  # of the scene's size, over the first 20 steps with the direct solver


@pytest.mark.mpi
@pytest.mark.parametrize("d", [2, 3])
def test_one_rank_and_two_agree(d, tmp_path):
    mpirun = shutil.which("mpirun")
    if mpirun is None:
        pytest.skip("there is no mpirun")
    results = []
    for ranks in (1, 2):
        out = tmp_path / f"{ranks}.npz"
        command = [sys.executable, str(Path(__file__).with_name("fall_on_ranks.py")), str(d), str(out)]
        command = command if ranks == 1 else [mpirun, "-n", str(ranks), *command]
        done = subprocess.run(command, env={**os.environ, **ENVIRONMENT}, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        results.append(np.load(out))
    one, two = results
    assert (int(one["ranks"]), int(two["ranks"])) == (1, 2)
    assert two["owned"].min() > 0
    assert one["positions"].shape[0] == STEPS
    np.testing.assert_array_equal(one["cuts"], 0)  # a cut step on one side only would be another motion
    assert one["contacts"].max() > 2
    kinds = list(one["kinds"])
    assert all(one["energies"][:, kinds.index(kind)].max() > 0.0 for kind in ("barrier", "friction"))
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=SAME * SIZE)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-3, atol=1e-6 * np.abs(one["energies"]).max())
