"""A run killed at any instant: what is found afterwards is whole, in a row, and equal to what was written."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import runs

from pdvol.errors import InputError
from pdvol.store.writer import RunWriter, open_run

KILLS = 10
VERTICES = 400

_WRITE = """
import sys; sys.path[:0] = {folders!r}
import test_kill, runs
from pdvol.store.writer import RunWriter
print("ready", flush=True)
with RunWriter.open({run!r}) as writer:
    while True:
        step = writer.steps(0)
        writer.write_state(0, step, test_kill.state(step), runs.record(0, step))
"""

_CREATE = """
import sys; sys.path[:0] = {folders!r}
import runs, test_store
from pdvol.store.writer import RunWriter
meshes = runs.level_meshes(2, (60, 2000, 6000))
print("ready", flush=True)
RunWriter.create({run!r}, test_store.INFO, meshes, ["a", "b"])
"""


def state(step: int) -> np.ndarray:
    """What is written as the state of a step."""
    return np.random.default_rng(step).normal(size=(VERTICES, 2))


def killed_after(seconds: float, program: str, run: Path) -> None:
    """Start a program, wait until it has said "ready" and `seconds` more, and kill it."""
    folders = [str(Path(file).parent) for file in (__file__, runs.__file__)]
    code = program.format(folders=folders, run=str(run))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "ready\n"
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)


def test_states_survive_kills(tmp_path):
    points = state(0)
    cells = np.arange(VERTICES - 2)[:, None] + [0, 1, 2]
    labels = np.zeros(len(cells), np.int32)
    path = tmp_path / "run"
    RunWriter.create(path, {"dt": 0.1, "steps": 10**6}, [runs.LevelMesh(points, cells, labels, labels)], ["a"]).close()
    waits = np.random.default_rng(7).uniform(0.02, 0.15, KILLS)
    found, checked = 0, 0
    for wait in waits:
        killed_after(wait, _WRITE, path)
        level = open_run(path).levels[0]
        assert level.steps >= found
        found = level.steps
        for step in range(checked, found):
            np.testing.assert_array_equal(level.positions(step), state(step))
        checked = max(0, found - 1)
    assert found > KILLS
    RunWriter.open(path).close()
    assert [record["step"] for record in open_run(path).levels[0].log] == list(range(found))
    assert not list(path.rglob(".*.tmp"))


def test_a_creation_that_was_killed_can_be_repeated(tmp_path):
    seen = set()
    for i, wait in enumerate(np.linspace(0.0, 0.03, 6)):
        path = tmp_path / f"run{i}"
        killed_after(wait, _CREATE, path)
        try:
            open_run(path)
            seen.add("whole")
        except InputError as error:
            seen.add("part")
            assert (
                "interrupted before its first step" in str(error)
                or "no run.json" in str(error)
                or "does not exist" in str(error)
            )
            with RunWriter.create(path, {"dt": 0.1, "steps": 1}, runs.level_meshes(2, (60,)), ["a", "b"]) as writer:
                writer.write_state(0, 0, runs.level_meshes(2, (60,))[0].points)
            assert open_run(path).levels[0].steps == 1 and len(open_run(path).levels) == 1
    assert "part" in seen
