"""What carries out command lines on this machine: fresh processes, or workers that stay."""

import contextlib
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from pdvol.processes import die_with_parent, without_launcher
from pdvol.studio.variations.worker import Worker, WorkerEnded

GRACE = 5.0  # seconds that a process has to end after the request; it stores a state in less


class Processes:
    """A process of its own for each command line: its processor time is what a user's own run takes.

    Attributes
    ----------
    count : of command lines at a time
    """

    def __init__(self, count: int):
        self.count = count

    def start(self, words: Sequence[str], log: Path) -> "Process":
        """Carry out `pdvol` with these words; what it prints goes to the file `log`."""
        return Process(words, log)

    def close(self) -> None:
        """Nothing is left to free."""


class Process:
    """A command line in a process of its own."""

    def __init__(self, words: Sequence[str], log: Path):
        with open(log, "w") as output:
            # A session of its own: Ctrl-C is for the process that keeps the runs.
            self._process = subprocess.Popen(
                [sys.executable, "-m", "pdvol", *words],
                env=without_launcher(),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
                preexec_fn=die_with_parent,
            )

    def poll(self) -> int | None:
        """Its exit code; None while it is carried out."""
        return self._process.poll()

    def stop(self) -> None:
        """End it; whole states are kept."""
        self._process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE)
        self._process.kill()
        self._process.wait()


class Workers:
    """Processes that stay: libraries are loaded once in each.

    Attributes
    ----------
    count : of processes, and so of command lines at a time
    """

    def __init__(self, count: int):
        self.count = count
        self._workers: list[Worker] = []

    def start(self, words: Sequence[str], log: Path) -> Worker:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`. Ended workers are replaced.

        Raises
        ------
        RuntimeError
            All are busy.
        """
        for worker in [worker for worker in self._workers if not worker.alive]:
            self._remove(worker)
        for free in [worker for worker in self._workers if not worker.busy]:
            try:
                free.start(words, log)
                return free
            except WorkerEnded:  # after it was found alive: a large one ends once it has answered
                self._remove(free)
        if len(self._workers) >= self.count:
            raise RuntimeError("all workers are busy")
        new = Worker()
        self._workers.append(new)
        new.start(words, log)
        return new

    def _remove(self, worker: Worker) -> None:
        worker.stop()
        self._workers.remove(worker)

    def close(self) -> None:
        """End all processes."""
        for worker in self._workers:
            worker.stop()
        self._workers.clear()
