"""Slurm's script, with the launcher of this machine in the place of srun."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cli_scenes import FALL, pdvol
from commands import SAFETY
from pdvol import open_run
from pdvol.runs import launcher

SCRIPT = Path(__file__).resolve().parents[2] / "packaging" / "slurm.sh"
SRUN = """#!/bin/bash
echo "$@" >>"$CALLS"
while [[ $1 == -* ]]; do case "$1" in --ntasks=*) count=${1#--ntasks=} ;; esac; shift; done
exec ${LAUNCH:-LAUNCHER} -n "$count" "$@"
"""
pytestmark = [
    pytest.mark.mpi,
    pytest.mark.skipif(launcher.launcher() is None or not SCRIPT.is_file(), reason="there is no mpirun, or no script"),
]


def test_coarse_levels_run_on_one_task_and_fine_ones_on_all_and_a_second_job_goes_on(tmp_path):
    scene, alone, run, calls = (tmp_path / name for name in ("fall.py", "alone", "run", "calls"))
    scene.write_text(FALL)
    words, environment = launcher.rank_command(2)
    tools = tmp_path / "bin"
    tools.mkdir()
    (tools / "srun").write_text(SRUN.replace("LAUNCHER", words[0]))
    (tools / "pdvol").write_text(f'#!/bin/bash\nexec {sys.executable} -m pdvol "$@"\n')
    for tool in tools.iterdir():
        tool.chmod(0o755)
    path = os.pathsep.join([str(tools), os.environ["PATH"]])
    environment = {**environment, "PATH": path, "CALLS": str(calls), "SLURM_NTASKS": "2"}
    job = ["bash", str(SCRIPT), str(scene), str(run), "1", "1", "--no-xdmf"]
    assert pdvol("run", scene, "--out", alone, "--no-picture", "--no-xdmf") == 0
    for more in ({}, {"LAUNCH": "true"}):  # what the second job calls, which has nothing to do, is not started
        done = subprocess.run(job, env=environment | more, capture_output=True, text=True, timeout=SAFETY)
        assert done.returncode == 0, done.stderr
    first, *later = [line.split() for line in calls.read_text().splitlines()]
    assert "--ntasks=1" in first and "0:0" in first and "--resume" not in first
    assert len(later) == 3 and all("--resume" in line for line in later)
    one, two = open_run(alone).levels, open_run(run).levels
    assert [record["ranks"] for record in two[1].log] == [2] * len(one[1].log)
    for level, other in zip(one, two, strict=True):
        np.testing.assert_allclose(other.positions(level.steps - 1), level.positions(level.steps - 1), atol=1e-4)
