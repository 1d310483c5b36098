"""Runs in processes: done, gone on with, failed, stopped."""

import time

import pytest

from cli_scenes import FALL, write
from pdvol.explore.jobs import Job, run_jobs, stored_outcome
from pdvol.store.reader import open_run

STEPS = 6


@pytest.fixture
def scene(tmp_path):
    write(tmp_path / "fall.py", FALL)
    return tmp_path / "fall.py"


def job(scene, name, steps=STEPS, words=()):
    return Job(name, [str(scene), "--steps", str(steps), *words], scene.parent / "runs" / name, range(2), steps)


def in_turn(*jobs):
    """A `choose` that gives each job once."""
    queue = list(jobs)
    return lambda running, left: queue.pop(0) if queue else None


def test_each_job_ends_as_its_run_does(scene):
    good, bad = job(scene, "good"), job(scene, "bad", words=("--set", "max_iterations=1", "--set", "max_halvings=0"))
    wrong = job(scene, "wrong", words=("--set", "colour=1"))
    found = {outcome.job.name: outcome for outcome in run_jobs(in_turn(good, bad, wrong), 2)}
    assert found["good"].state == "done" and found["good"].seconds > 0.0
    assert found["bad"].state == "failed" and "level 0" in found["bad"].reason
    assert found["wrong"].state == "failed" and "no parameter 'colour'" in found["wrong"].reason
    assert [level.steps for level in open_run(good.out).levels] == [STEPS + 1, STEPS + 1]
    assert not (good.out / "picture.png").exists()
    begin = time.monotonic()
    again = {outcome.job.name: outcome for outcome in run_jobs(in_turn(good, bad), 2)}
    assert again["good"].state == "done" and again["good"].seconds == 0.0, "nothing ran again"
    assert again["bad"].state == "failed" and again["bad"].reason == found["bad"].reason
    assert time.monotonic() - begin < found["good"].seconds


def test_what_runs_at_the_deadline_is_stopped_and_can_go_on(scene):
    long = job(scene, "long", steps=100_000)
    (outcome,) = run_jobs(in_turn(long), 1, time.monotonic() + 6.0)
    assert outcome.state == "stopped" and stored_outcome(long) is None
    if not (long.out / "run.json").exists():
        return  # a busy machine did not come as far
    stored = open_run(long.out).levels[0].steps
    (outcome,) = run_jobs(in_turn(job(scene, "long", steps=max(stored, 2))), 1)
    assert outcome.state == "done" and open_run(long.out).levels[0].steps >= stored
