"""Runs in processes: done, gone on with, failed, stopped."""

import os
import signal
import time
from contextlib import closing

import pytest

import runs
from cli_scenes import FALL, write
from pdvol.errors import InputError
from pdvol.store.reader import open_run
from pdvol.studio.wedge.jobs import MOST_STARTS, Job, run_jobs, stored_outcome
from pdvol.studio.workers import Workers

STEPS = 6


@pytest.fixture
def scene(tmp_path):
    return write(tmp_path / "fall.py", FALL)


@pytest.fixture(params=[True, False], ids=["fresh", "staying"])
def executor(request):
    made = Workers(2, request.param)
    yield made
    made.close()


def job(scene, name, steps=STEPS, words=(), levels=2):
    words = [str(scene), "--steps", str(steps), "--levels", f"0:{levels - 1}", *words]
    return Job(name, words, scene.parent / "runs" / name, range(levels), steps)


def in_turn(*jobs):
    """A `choose` that gives each job once."""
    queue = list(jobs)
    return lambda running, left: queue.pop(0) if queue else None


def test_each_job_ends_as_its_run_does(scene, executor):
    good, bad = job(scene, "good"), job(scene, "bad", words=("--set", "max_iterations=1", "--set", "max_halvings=0"))
    wrong = job(scene, "wrong", words=("--set", "colour=1"))
    found = {outcome.job.name: outcome for outcome in run_jobs(in_turn(good, bad, wrong), executor)}
    assert found["good"].state == "done" and found["good"].seconds > 0.0
    assert found["bad"].state == "failed" and "level 0" in found["bad"].reason
    assert found["wrong"].state == "failed" and "no parameter 'colour'" in found["wrong"].reason
    assert [level.steps for level in open_run(good.out).levels] == [STEPS + 1, STEPS + 1]
    assert not (good.out / "picture.png").exists()
    begin = time.monotonic()
    again = {outcome.job.name: outcome for outcome in run_jobs(in_turn(good, bad), executor)}
    assert again["good"].state == "done" and again["good"].seconds == 0.0, "nothing ran again"
    assert again["bad"].state == "failed" and again["bad"].reason == found["bad"].reason
    assert time.monotonic() - begin < found["good"].seconds


@pytest.mark.parametrize("executor", [False], indirect=True)
def test_what_runs_at_the_deadline_is_stopped_and_can_go_on(scene, executor):
    long = job(scene, "long", steps=100_000, levels=1)
    (outcome,) = run_jobs(in_turn(long), executor, time.monotonic() + 3.0)
    assert outcome.state == "stopped" and stored_outcome(long) is None
    try:
        stored = open_run(long.out).levels[0].steps
    except InputError:
        stored = 0  # a busy machine did not come as far
    (outcome,) = run_jobs(in_turn(job(scene, "long", steps=stored + 5, levels=1)), executor)
    assert outcome.state == "done" and open_run(long.out).levels[0].steps == stored + 6


def test_a_job_whose_worker_is_killed_is_run_again(scene):
    workers, hurt = Workers(2), job(scene, "hurt", steps=40)
    killed = []

    def choose(running, left):
        if not running:
            return None if killed else hurt
        if not killed and runs.count(hurt.out / "levels" / "0") > 3:
            (busy,) = (worker for worker in workers._workers if worker.busy)
            os.kill(busy.process, signal.SIGKILL)
            killed.append(busy.process)
        return None

    outcomes = list(run_jobs(choose, workers))
    workers.close()
    assert [outcome.state for outcome in outcomes] == ["done"] and len(killed) == 1
    other = job(scene, "unhurt", steps=40)
    with closing(Workers(1, fresh=True)) as fresh:
        (outcome,) = run_jobs(in_turn(other), fresh)
    runs.assert_same_runs(hurt.out, other.out, logs=False)


class Deadly:
    """An executor whose processes are killed at once."""

    count, starts = 1, 0

    def start(self, words, log):
        self.starts += 1
        return self

    def poll(self):
        return -signal.SIGKILL


def test_a_job_that_is_always_killed_fails_after_some_starts(scene):
    executor = Deadly()
    (outcome,) = run_jobs(in_turn(job(scene, "never")), executor)
    assert outcome.state == "failed" and executor.starts == MOST_STARTS and "killed" in outcome.reason
