"""What contact holds back, and what is released, is the same on two ranks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from test_ranks import ENVIRONMENT


@pytest.mark.mpi
def test_one_rank_and_two_are_held_back_alike(tmp_path):
    mpirun = shutil.which("mpirun")
    if mpirun is None:
        pytest.skip("there is no mpirun")
    results = []
    for count in (1, 2):
        out = tmp_path / f"{count}.npz"
        command = [sys.executable, str(Path(__file__).with_name("press_on_ranks.py")), str(out)]
        command = command if count == 1 else [mpirun, "-n", str(count), *command]
        done = subprocess.run(command, env={**os.environ, **ENVIRONMENT}, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        results.append(np.load(out))
    one, two = results
    assert (int(one["ranks"]), int(two["ranks"])) == (1, 2)
    assert one["substeps"].max() > 1 and one["behind"].max() > 0.0
    # Parts end where detection says so: a step cut in many parts adds up differences of the linear solves.
    np.testing.assert_allclose(two["behind"], one["behind"], rtol=0.0, atol=1e-5)
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=1e-4 * 0.4)
