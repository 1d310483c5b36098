"""What a program leaves on several numbers of ranks."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from commands import SAFETY

# Ranks give way while they wait, or a busy machine spends its time on their spinning; mpirun ends them itself when it
# takes too long.
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "PYTHONPATH": str(Path(__file__).parent),
    "OMPI_MCA_mpi_yield_when_idle": "1",
    "MPIEXEC_TIMEOUT": str(int(SAFETY)),
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}


def results_on(counts: tuple[int, ...], folder: Path, program: Path, *words: str) -> list:
    """The arrays that `program WORDS FILE.npz` writes on one rank and on more, its `ranks` checked. Skips where nothing
    starts several.
    """
    mpirun = shutil.which("mpirun")
    if mpirun is None:
        pytest.skip("there is no mpirun")
    results = []
    for count in counts:
        out = folder / f"{count}.npz"
        command = [sys.executable, str(program), *words, str(out)]
        command = command if count == 1 else [mpirun, "-n", str(count), *command]
        done = subprocess.run(
            command, env={**os.environ, **ENVIRONMENT}, capture_output=True, text=True, timeout=SAFETY + 60
        )
        assert done.returncode == 0, done.stderr
        results.append(np.load(out))
        assert int(results[-1]["ranks"]) == count
    return results
