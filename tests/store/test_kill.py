"""A run is killed at any instant. The states found afterwards are complete, consecutive, and equal to those that were
written.
"""

import os
import signal
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from test_store import INFO

import runs
from commands import SAFETY
from killing import FileOperations
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.store.writer import RunWriter

KILLS = 5
VERTICES = 400


def state(step: int) -> np.ndarray:
    """What is written as the state of a step."""
    return np.random.default_rng(step).normal(size=(VERTICES, 2))


def ended(work: Callable[[], object], run: Path, deadly: int) -> tuple[int, int]:
    """The exit code of a copy of this process that does the work and is killed before a file operation in the run's
    folder, or comes to the work's end; and the number of file operations, 0 where it was killed.
    """
    read, write = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads, which the copy does not have
        child = os.fork()
    if child == 0:
        code = 1
        try:
            signal.alarm(int(SAFETY))  # where the kill does not come
            operations = FileOperations(str(run), deadly)
            work()
            os.write(write, str(operations.count).encode())
            code = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)  # nothing of the tests runs on in the copy
    os.close(write)
    with os.fdopen(read) as count:
        operations = int(count.read() or 0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), operations


def test_states_survive_kills(tmp_path):
    points = state(0)
    cells = np.arange(VERTICES - 2)[:, None] + [0, 1, 2]
    labels = np.zeros(len(cells), np.int32)
    path = tmp_path / "run"
    RunWriter.create(path, {"dt": 0.1, "steps": 10**6}, [runs.LevelMesh(points, cells, labels, labels)], ["a"]).close()

    def write_on():
        with RunWriter.open(path) as writer:
            while True:
                step = writer.steps(0)
                writer.write_state(0, step, state(step), runs.record(0, step))

    found, checked = 0, 0
    for deadly in np.random.default_rng(7).integers(40, 120, KILLS):
        assert ended(write_on, path, deadly) == (-signal.SIGKILL, 0)
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
    seen, meshes = set(), runs.level_meshes(2, (60, 2000, 6000))
    creation = lambda path: lambda: RunWriter.create(path, INFO, meshes, ["a", "b"])
    code, operations = ended(creation(tmp_path / "whole"), tmp_path / "whole", 0)
    assert code == 0 < operations
    for i, deadly in enumerate(np.linspace(1, operations, 4).astype(int)):
        path = tmp_path / f"run{i}"
        assert ended(creation(path), path, deadly) == (-signal.SIGKILL, 0)
        try:
            open_run(path)
            seen.add("whole")
        except InputError as error:
            seen.add("part")
            said = ("interrupted before its first step", "no run.json", "does not exist")
            assert any(part in str(error) for part in said)
            with RunWriter.create(path, {"dt": 0.1, "steps": 1}, runs.level_meshes(2, (60,)), ["a", "b"]) as writer:
                writer.write_state(0, 0, runs.level_meshes(2, (60,))[0].points)
            assert open_run(path).levels[0].steps == 1 and len(open_run(path).levels) == 1
    assert "part" in seen
