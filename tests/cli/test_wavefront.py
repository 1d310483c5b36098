"""Levels side by side: the same numbers as one after the other, and what happens when one cannot go on."""

import json
import os
import signal
import subprocess
import sys

import pytest

from cli_scenes import BOUNCE, pdvol, pdvol_on_ranks, states
from commands import SAFETY
from on_ranks import results_on
from pdvol import open_run
from pdvol.runs import runner
from runs import assert_same_runs

DYING = """
import os, signal, sys

stored = []

def die(event, arguments):
    if event == "open" and str(arguments[0]).endswith("levels/1/states.bin") and arguments[2] & os.O_WRONLY:
        if len(stored) == 5:
            os.kill(os.getpid(), signal.SIGKILL)
        stored.append(event)

sys.addaudithook(die)
import pdvol
pdvol.main()
"""
"""pdvol's command in a process that is killed just before it stores step 5 of level 1."""
ENVIRONMENT = {**os.environ, "OMP_NUM_THREADS": "1"}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenes") / "bounce.py"
    three = BOUNCE.replace("(60, 120), steps=8", "(30, 60, 120), steps=14").replace("beside=False", "beside=True")
    file.write_text(three)
    return file


@pytest.fixture(scope="module")
def one_after_the_other(scene, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs") / "sequential"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runner, "side_by_side", None)  # nothing asks
        assert pdvol("run", scene, "--out", out, "--no-wavefront") == 0
    return out


def test_levels_are_side_by_side_by_choice(scene, one_after_the_other, tmp_path, monkeypatch):
    asked, marched = [], []
    monkeypatch.setattr(runner, "side_by_side", lambda *given: not asked.append(given))
    march = runner.march_levels
    monkeypatch.setattr(runner, "march_levels", lambda *given: marched.append(list(given[1])) or march(*given))
    assert pdvol("run", scene, "--out", tmp_path / "chosen", "--to", "1", "--no-picture") == 0
    assert marched == [[0, 1]]
    assert asked == [([len(level.mesh.points) for level in open_run(tmp_path / "chosen").levels], [15] * 2)]
    for level in (0, 1):
        assert states(tmp_path / "chosen", level) == states(one_after_the_other, level)


def test_a_killed_wavefront_goes_on_where_it_was(scene, one_after_the_other, tmp_path):
    out = tmp_path / "run"
    words = ["run", str(scene), "--out", str(out), "--wavefront"]
    # Standard error ends when the last of the processes has ended, those of the levels included.
    killed = subprocess.run(
        [sys.executable, "-c", DYING, *words], env=ENVIRONMENT, stderr=subprocess.PIPE, timeout=SAFETY
    )
    assert killed.returncode == -signal.SIGKILL, killed.stderr
    assert open_run(out).levels[1].steps == 5
    assert pdvol("run", scene, "--out", out, "--wavefront", "--resume") == 0
    assert_same_runs(out, one_after_the_other)
    assert open_run(out).info["state"] == "done" and len(list(out.glob("level_*.xdmf"))) == 3
    levels = [json.loads(line)["level"] for line in (out / "log.jsonl").read_text().splitlines()]
    assert levels != sorted(levels), "no level ran beside another"


def test_a_level_that_cannot_go_on_ends_the_finer_ones(scene, tmp_path, capfd):
    out = tmp_path / "run"
    words = ["--set", "iterations=1", "--set", "halvings=0", "--set", "tolerance=1e-12"]
    assert pdvol("run", scene, "--out", out, "--wavefront", "--levels", "0:1", *words) == 1
    assert capfd.readouterr().err.strip().splitlines()[-1].startswith("pdvol: level 0, step 1:")
    assert open_run(out).info["state"] == "failed"


@pytest.mark.mpi
def test_ranks_and_a_wavefront_do_not_go_together(scene, tmp_path):
    (done,) = results_on((2,), pdvol_on_ranks, "run", scene, "--out", tmp_path / "run", "--wavefront")
    assert done["code"] == 2
    assert "--wavefront" in str(done["said"])
    assert not (tmp_path / "run").exists()
