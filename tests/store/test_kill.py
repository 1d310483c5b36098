"""A run is killed at any instant. The states found afterwards are complete, consecutive, and equal to those that were
written.
"""

import signal
import subprocess
import sys
from pathlib import Path

import numpy as np

import runs
from commands import SAFETY
from killing import HELPERS
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter

KILLS = 5
VERTICES = 400

_WRITE = """
import sys; sys.path[:0] = {folders!r}
import test_kill, runs
from killing import FileOperations
from pdvol.store.writer import RunWriter
FileOperations({run!r}, {deadly})
with RunWriter.open({run!r}) as writer:
    while True:
        step = writer.steps(0)
        writer.write_state(0, step, test_kill.state(step), runs.record(0, step))
"""

_CREATE = """
import sys; sys.path[:0] = {folders!r}
import runs, test_store
from killing import FileOperations
from pdvol.store.writer import RunWriter
meshes = runs.level_meshes(2, (60, 2000, 6000))
operations = FileOperations({run!r}, {deadly})
RunWriter.create({run!r}, test_store.INFO, meshes, ["a", "b"])
print(operations.count)
"""


def state(step: int) -> np.ndarray:
    """What is written as the state of a step."""
    return np.random.default_rng(step).normal(size=(VERTICES, 2))


def ended(program: str, run: Path, deadly: int) -> subprocess.CompletedProcess:
    """A program that was killed before a file operation, or has come to its end."""
    code = program.format(folders=[str(Path(__file__).parent), HELPERS], run=str(run), deadly=deadly)
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=SAFETY)


def test_states_survive_kills(tmp_path):
    points = state(0)
    cells = np.arange(VERTICES - 2)[:, None] + [0, 1, 2]
    labels = np.zeros(len(cells), np.int32)
    path = tmp_path / "run"
    RunWriter.create(path, {"dt": 0.1, "steps": 10**6}, [runs.LevelMesh(points, cells, labels, labels)], ["a"]).close()
    found, checked = 0, 0
    for deadly in np.random.default_rng(7).integers(40, 120, KILLS):
        assert ended(_WRITE, path, deadly).returncode == -signal.SIGKILL
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
    whole = ended(_CREATE, tmp_path / "whole", 0)
    assert whole.returncode == 0, whole.stderr
    for i, deadly in enumerate(np.linspace(1, int(whole.stdout), 4).astype(int)):
        path = tmp_path / f"run{i}"
        assert ended(_CREATE, path, deadly).returncode == -signal.SIGKILL
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
