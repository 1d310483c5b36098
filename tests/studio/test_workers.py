"""The process that carries out one command line after the other."""

import os
import signal
import time
from contextlib import closing

import pytest

from cli_scenes import FALL, write
from pdvol.store.folder import holds_run, read_info
from pdvol.store.reader import open_run
from pdvol.studio.workers import Worker, Workers
from runs import assert_same_runs

STEPS = 5
PATIENCE_OF_TESTS = 120.0  # seconds for one short run on a busy machine


@pytest.fixture
def worker():
    made = Worker()
    yield made
    made.stop()


@pytest.fixture
def scene(tmp_path):
    return write(tmp_path / "fall.py", FALL)


def words(scene, name, *more):
    return ["run", scene, "--steps", STEPS, "--out", scene.parent / name, "--no-picture", "--no-xdmf", *more]


def wait(worker, condition):
    limit = time.monotonic() + PATIENCE_OF_TESTS
    while not condition():
        assert time.monotonic() < limit and worker.poll() is None
        time.sleep(0.02)


def steps(folder):
    """Stored states of level 0."""
    ready = holds_run(folder) and read_info(folder).get("state") != "creating"
    return open_run(folder).levels[0].steps if ready else 0


def ended(worker):
    """The exit code of the command line that is carried out."""
    return worker.answer(PATIENCE_OF_TESTS)[1]


def test_a_worker_that_ends_after_it_was_found_alive_is_replaced(scene, monkeypatch):
    """As a large one does, just after its answer. The broken pipe to it ends nothing."""
    with closing(Workers(1)) as workers:
        first = workers.start(words(scene, "first"), scene.parent / "first.log")
        assert ended(first) == 0
        os.kill(first.process, signal.SIGKILL)
        os.waitid(os.P_PID, first.process, os.WEXITED | os.WNOWAIT)  # it has ended, which nobody has seen
        with monkeypatch.context() as patch:
            patch.setattr(Worker, "alive", True)
            second = workers.start(words(scene, "second"), scene.parent / "second.log")
        assert second is not first and ended(second) == 0


def test_a_held_worker_stores_no_state_until_it_goes_on(worker, scene):
    worker.start(words(scene, "held", "--steps", 100_000), scene.parent / "held.log")
    folder = scene.parent / "held"
    wait(worker, lambda: steps(folder) >= 3)
    worker.pause()
    time.sleep(0.2)
    held = steps(folder)
    time.sleep(0.5)
    assert worker.paused and steps(folder) == held
    worker.resume()
    wait(worker, lambda: steps(folder) > held)
    worker.stop()
    assert not worker.alive and steps(folder) > held


def test_an_interrupted_worker_carries_out_the_next_run_as_any_other(worker, scene):
    worker.start(words(scene, "before"), scene.parent / "before.log")
    assert ended(worker) == 0
    worker.start(words(scene, "long", "--steps", 100_000), scene.parent / "long.log")
    wait(worker, lambda: steps(scene.parent / "long") >= 3)
    worker.interrupt()
    assert ended(worker) == 130 and worker.alive
    assert "interrupted" in (scene.parent / "long.log").read_text()
    worker.interrupt()  # nothing runs: nothing happens
    worker.start(words(scene, "after"), scene.parent / "after.log")
    assert ended(worker) == 0
    assert_same_runs(scene.parent / "before", scene.parent / "after", logs=False)
