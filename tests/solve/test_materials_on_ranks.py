"""The number of ranks changes neither what cells are made of nor what loads and damping do."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from test_ranks import ENVIRONMENT

SAME = 1e-9  # of the unit box, over five steps with the direct solver


@pytest.mark.mpi
@pytest.mark.parametrize("d", [2, 3])
def test_materials_and_loads_on_two_ranks(d, tmp_path):
    if shutil.which("mpirun") is None:
        pytest.skip("there is no mpirun")
    results = []
    for count in (1, 2):
        out = tmp_path / f"{count}.npz"
        command = ["mpirun", "-n", str(count), sys.executable, str(Path(__file__).with_name("materials_on_ranks.py")), str(d), str(out)]
        done = subprocess.run(command, env={**os.environ, **ENVIRONMENT}, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        results.append(np.load(out))
    one, two = results
    assert (int(one["ranks"]), int(two["ranks"])) == (1, 2)
    for name in ("young", "density", "law"):
        np.testing.assert_array_equal(one[name], two[name])
    assert set(one["law"]) == {0, 1, 2} and one["young"].max() == 1e9
    assert all(np.abs(one["energies"][:, list(one["kinds"]).index(kind)]).max() > 0.0 for kind in ("elastic", "damping", "drag", "load"))
    assert np.abs(one["positions"][-1] - one["rest"]).max() > 1e-3
    np.testing.assert_allclose(two["positions"], one["positions"], rtol=0.0, atol=SAME)
    np.testing.assert_allclose(two["energies"], one["energies"], rtol=1e-5, atol=1e-9 * np.abs(one["energies"]).max())
