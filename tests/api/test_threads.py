"""pdvol leaves its host's threads as they are: it uses one of the BLAS while it simulates."""

import os
import subprocess
import sys

PROGRAM = """
import os
import pdvol
assert "OMP_NUM_THREADS" not in os.environ, "set by import"
from pdvol import Body, NeoHookean, Scene, meshes
import numpy
from threadpoolctl import threadpool_info
counts = lambda: {pool["num_threads"] for pool in threadpool_info()}
before, during = counts(), set()
scene = Scene((Body((meshes.brick((1.0, 1.0, 1.0), (2, 2, 2)),), NeoHookean(1e5), name="block"),), dt=0.01, steps=1)
pdvol.run(scene, progress=lambda record: during.update(counts()))
assert during == {1}, during
assert "OMP_NUM_THREADS" not in os.environ, "set by a run"
assert max(before) == max(counts()) == 2, (before, counts())
"""


def test_a_host_keeps_its_threads():
    free = {key: value for key, value in os.environ.items() if key != "OMP_NUM_THREADS"}
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM], env=free | {"OPENBLAS_NUM_THREADS": "2"}, capture_output=True, text=True
    )
    assert ended.returncode == 0, ended.stderr
