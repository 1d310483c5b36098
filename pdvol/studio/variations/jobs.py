"""Jobs: runs that are to be made, each a normal run folder, carried out some at a time by an executor. What is stored
already is gone on with.
"""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from pdvol.errors import InputError
from pdvol.store.folder import holds_run
from pdvol.store.reader import open_run
from pdvol.studio.variations.worker import last_line

JOB_POLL = 0.02  # seconds between looks at what runs
MOST_STARTS = 3  # of a job whose process is killed by others, for want of memory say


class Execution(Protocol):
    """A command line that is carried out."""

    def poll(self) -> int | None:
        """Its exit code; None while it is carried out. A negative one is the signal that has ended its process."""

    def stop(self) -> None:
        """End it; whole states are kept."""


class Executor(Protocol):
    """What carries out command lines.

    Attributes
    ----------
    count : of command lines at a time
    """

    @property
    def count(self) -> int: ...

    def start(self, words: Sequence[str], log: Path) -> Execution:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`."""

    def close(self) -> None:
        """Free what carried them out."""


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

    def command(self) -> list[str]:
        """The words after `pdvol`. The run goes on where its folder holds a part of it."""
        return ["run", *self.words, "--out", str(self.out), "--resume", "--ranks", "1", "--no-picture", "--no-xdmf"]


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


class _Running:
    """A job that an executor carries out."""

    def __init__(self, job: Job, executor: Executor):
        self.job, self.begin, self.beside = job, time.monotonic(), 0
        self._executor, self._starts = executor, 0
        job.out.parent.mkdir(parents=True, exist_ok=True)
        self.log = job.out.with_name(f"{job.out.name}.log")
        self._start()

    def _start(self) -> None:
        self._starts += 1
        self._execution = self._executor.start(self.job.command(), self.log)

    def outcome(self) -> Outcome | None:
        """None while it runs. A job whose process was killed is started again."""
        code = self._execution.poll()
        if code is not None and code < 0 and self._starts < MOST_STARTS:
            self._start()
            return None
        if code is None:
            return None
        seconds = time.monotonic() - self.begin
        load = {"average": os.getloadavg()[0], "jobs_beside": self.beside}
        if code == 0:
            return Outcome(self.job, "done", "", seconds, load)
        if code < 0:
            reason = f"its process was killed {self._starts} times (signal {-code})"
        else:
            reason = last_line(self.log) or f"it ended with status {code}"
        return Outcome(self.job, "failed", reason, seconds, load)

    def stop(self) -> None:
        """Ends it; whole states are kept."""
        self._execution.stop()


def run_jobs(
    choose: Callable[[Sequence[Job], float], Job | None], executor: Executor, deadline: float = float("inf")
) -> Iterator[Outcome]:
    """Run jobs, as many at a time as the executor takes, until `choose` gives no more; yields each one's outcome as it
    ends.

    Parameters
    ----------
    choose : called with the jobs that run and the seconds left; gives the next job, or None where none is to start now
    deadline : on `time.monotonic()`'s clock [s]: what runs then is stopped
    """
    running: list[_Running] = []
    try:
        while True:
            left = deadline - time.monotonic()
            while len(running) < executor.count and left > 0:
                job = choose([process.job for process in running], left)
                if job is None:
                    break
                stored = stored_outcome(job)
                if stored is not None:
                    yield stored
                    continue
                running.append(_Running(job, executor))
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
