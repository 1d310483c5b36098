"""Runs in processes side by side, each a normal run folder. What is stored already is gone on with."""

import contextlib
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

from pdvol.errors import InputError
from pdvol.processes import die_with_parent, without_launcher
from pdvol.store.folder import holds_run
from pdvol.store.reader import open_run

JOB_POLL = 0.05  # seconds between looks at the processes
GRACE = 5.0  # seconds that a process has to end after it was asked to; it stores a state in less


@dataclass
class Job:
    """One run that is to be made.

    Attributes
    ----------
    name : of its folder
    words : after `pdvol run`, without the run folder
    out : its run folder
    levels : the levels that have to be complete
    steps : of each of them
    """

    name: str
    words: Sequence[str]
    out: Path
    levels: range
    steps: int


@dataclass
class Outcome:
    """How a job ended.

    Attributes
    ----------
    state : "done", "failed" or "stopped"
    reason : one line, where it failed
    seconds : from its start [s]; 0 where it was stored before
    load : the machine's load average at its end, and how many jobs ran beside it at most
    """

    job: Job
    state: str
    reason: str = ""
    seconds: float = 0.0
    load: dict[str, float] = field(default_factory=dict)


def stored_outcome(job: Job) -> Outcome | None:
    """The outcome of a job whose folder has it already; None where it has to run."""
    if not holds_run(job.out):
        return None
    try:
        run = open_run(job.out)
    except InputError:
        return None
    levels = [level for level in run.levels if level.index in job.levels]
    if len(levels) == len(job.levels) and all(level.steps > job.steps for level in levels):
        return Outcome(job, "done")
    failed = next((level for level in levels if level.info["state"] == "failed"), None)
    return None if failed is None else Outcome(job, "failed", str(failed.info.get("reason", "")))


class _Process:
    """A job that runs."""

    def __init__(self, job: Job):
        self.job, self.start, self.beside = job, time.monotonic(), 0
        job.out.parent.mkdir(parents=True, exist_ok=True)
        self.log = job.out.with_name(f"{job.out.name}.log")
        go_on = ["--resume"] if holds_run(job.out) else []
        with open(self.log, "w") as log:
            self._process = _start([*job.words, "--out", str(job.out), *go_on], log)

    def outcome(self) -> Outcome | None:
        """None while it runs."""
        code = self._process.poll()
        if code is None:
            return None
        seconds = time.monotonic() - self.start
        load = {"average": os.getloadavg()[0], "jobs_beside": self.beside}
        if code == 0:
            return Outcome(self.job, "done", "", seconds, load)
        return Outcome(self.job, "failed", self._last_line() or f"it ended with status {code}", seconds, load)

    def _last_line(self) -> str:
        lines = [line for line in self.log.read_text(errors="replace").splitlines() if line.strip()]
        return lines[-1].removeprefix("pdvol: ") if lines else ""

    def stop(self) -> None:
        """Ends it; whole states are kept."""
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE)
        self._process.kill()
        self._process.wait()


def _start(words: Sequence[str], log: TextIO) -> subprocess.Popen:
    # A session of its own: Ctrl-C is for the process that keeps the study.
    return subprocess.Popen(
        [sys.executable, "-m", "pdvol", "run", *words, "--no-picture", "--no-xdmf"],
        env=without_launcher(),
        stdin=subprocess.DEVNULL,
        stdout=log,
        stderr=log,
        start_new_session=True,
        preexec_fn=die_with_parent,
    )


def run_jobs(
    choose: Callable[[Sequence[Job], float], Job | None], count: int, deadline: float = float("inf")
) -> Iterator[Outcome]:
    """Run jobs, `count` at a time, until `choose` gives no more; yields each one's outcome as it ends.

    Parameters
    ----------
    choose : called with the jobs that run and the seconds left; gives the next job, or None where none is to start now
    deadline : on `time.monotonic()`'s clock [s]: what runs then is stopped
    """
    running: list[_Process] = []
    try:
        while True:
            left = deadline - time.monotonic()
            while len(running) < count and left > 0:
                job = choose([process.job for process in running], left)
                if job is None:
                    break
                stored = stored_outcome(job)
                if stored is not None:
                    yield stored
                    continue
                running.append(_Process(job))
            if not running:
                return
            for process in running:
                process.beside = max(process.beside, len(running) - 1)
            outcomes = [(process, process.outcome()) for process in running]
            for process, outcome in outcomes:
                if outcome is not None:
                    running.remove(process)
                    yield outcome
            if left <= 0:
                for process in [process for process, outcome in outcomes if outcome is None]:
                    running.remove(process)
                    process.stop()
                    yield Outcome(process.job, "stopped", "the budget of time was used up")
                return
            if all(outcome is None for _, outcome in outcomes):
                time.sleep(JOB_POLL)
    finally:
        for process in running:
            process.stop()


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0))
