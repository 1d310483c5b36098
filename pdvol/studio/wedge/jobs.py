"""Jobs: runs that are to be made, each a normal run folder, some at a time by worker processes. What is stored already
is gone on with. The folder of many runs, a study or a wedge, is kept by one process at a time.
"""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from pdvol.errors import InputError
from pdvol.store.files import jsonable, lock, make_folder, read_json, require_no_link_out, write_json
from pdvol.store.folder import holds_run
from pdvol.store.reader import open_run
from pdvol.studio.workers import Worker, Workers, last_line

JOB_POLL = 0.02  # seconds between looks at what runs
MOST_STARTS = 3  # of a job whose process is killed by others, for want of memory say


@dataclass
class Job:
    """One run that is to be made.

    Attributes
    ----------
    name : of its variation
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

    @property
    def log(self) -> Path:
        """The file of what its command prints, beside its run folder."""
        return self.out.with_name(f"{self.out.name}.log")


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


@dataclass
class _Running:
    """A job that a worker carries out; how often it was started, and how many ran beside it at most."""

    job: Job
    worker: Worker
    begin: float
    starts: int = 1
    beside: int = 0

    def outcome(self, workers: Workers) -> Outcome | None:
        """None while it runs. A job whose process was killed is started again."""
        code = self.worker.poll()
        if code is None:
            return None
        if code < 0 and self.starts < MOST_STARTS:
            self.worker, self.starts = workers.start(self.job.command(), self.job.log), self.starts + 1
            return None
        reason = ""
        if code < 0:
            reason = f"its process was killed {self.starts} times (signal {-code})"
        elif code > 0:
            reason = last_line(self.job.log) or f"it ended with status {code}"
        load = {"average": os.getloadavg()[0], "jobs_beside": self.beside}
        return Outcome(self.job, "failed" if code else "done", reason, time.monotonic() - self.begin, load)


def run_jobs(
    choose: Callable[[Sequence[Job], float], Job | None], workers: Workers, deadline: float = float("inf")
) -> Iterator[Outcome]:
    """Run jobs, as many at a time as there are workers, until `choose` gives no more; yields each one's outcome as it
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
            while len(running) < workers.count and left > 0:
                job = choose([one.job for one in running], left)
                if job is None:
                    break
                stored = stored_outcome(job)
                if stored is not None:
                    yield stored
                    continue
                job.out.parent.mkdir(parents=True, exist_ok=True)
                running.append(_Running(job, workers.start(job.command(), job.log), time.monotonic()))
            if not running:
                return
            for one in running:
                one.beside = max(one.beside, len(running) - 1)
            outcomes = [(one, one.outcome(workers)) for one in running]
            if left > 0 and not any(outcome for _, outcome in outcomes):
                time.sleep(JOB_POLL)
                continue
            for one, outcome in outcomes:
                if outcome is None and left <= 0:
                    one.worker.stop()
                    outcome = Outcome(one.job, "stopped", "the budget of time was used up")
                if outcome is not None:
                    running.remove(one)
                    yield outcome
    finally:
        for one in running:
            one.worker.stop()


def take_folder(file: Path, number: int, description: dict, empty: Mapping[str, Any]) -> TextIO:
    """Make the folder of many runs, or go on with the one that is there, and lock it.

    Parameters
    ----------
    file : `study.json` or `wedge.json` in it; its name says what the folder is
    number : of the file's format; lower ones are read
    description : of the scene; the one that a folder has must be the same
    empty : what a new file holds besides

    Returns
    -------
    file
        The lock, held until it is closed.

    Raises
    ------
    InputError
        The folder belongs to another scene or holds other files, cannot be made, or another process uses it.
    """
    out, kind = file.parent, file.stem
    description = jsonable(description)
    if file.exists():
        require_no_link_out(out)
        stored = read_json(file)
        if stored.get("format") not in range(1, number + 1):
            raise InputError(f"{file} has another format; choose another folder")
        if stored.get("description") != description:
            raise InputError(f"{out} holds a {kind} of another scene or other settings; choose another folder")
    else:
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file, not a folder")
        if out.exists() and any(path.name != f"{kind}.lock" for path in out.iterdir()):
            raise InputError(f"{out} is not empty and holds no {kind}; choose another folder")
        make_folder(out)
    held = lock(out / f"{kind}.lock")
    if held is None:
        raise InputError(f"{out} is used by another pdvol {kind}: wait for it to end, or choose another folder")
    if not file.exists():
        write_json(file, {"format": number, "description": description, **empty})
    return held
