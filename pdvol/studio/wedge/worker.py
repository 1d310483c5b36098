"""Processes that have all libraries loaded and carry out one command line of `pdvol` after the other."""

import contextlib
import gc
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from pdvol.processes import Process, ProcessEnded
from pdvol.registry import Entry

LOADED_BEFORE = ("pdvol.runs.runner", "pdvol.potentials.build")  # libraries that every run imports
TAIL = 8000  # bytes at the end of a log that are looked at for its last line
INTERRUPTED = 130  # exit code of a command line that was requested to end, as `pdvol.cli` gives it


class Worker(Process):
    """One process, which loads these modules, or those of a run, while the caller goes on."""

    def __init__(self, *modules: str) -> None:
        super().__init__(("pdvol.cli", *(modules or LOADED_BEFORE)))

    def start(self, words: Sequence[str], log: Path) -> None:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`. Raises as `begin`.

        Interrupted, its exit code is 130, and the process takes the next one. It may not follow, as long as it loads
        libraries or is in code that is not Python.
        """
        self.begin(carry_out, [str(word) for word in words], str(log))

    def poll(self) -> int | None:
        """The exit code of the command line; None while it is carried out.

        A negative number is the signal that has ended the process before the command line had.
        """
        try:
            found = self.answer() if self.busy else None
        except ProcessEnded:
            code = self.stop()
            return code if code < 0 else -signal.SIGKILL
        return None if found is None else int(found[1])


def carry_out(words: Sequence[str], log: str) -> int:
    """In the process: the exit code of a command line, which prints into a file."""
    with open(log, "w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    try:
        signal.signal(signal.SIGINT, signal.default_int_handler)
        code = Entry("pdvol.cli:run").load()(words)
    except KeyboardInterrupt:  # at the last moment
        code = INTERRUPTED
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except Exception:
        traceback.print_exc()
        code = 1
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        sys.stdout.flush()
        sys.stderr.flush()
    gc.collect()  # PETSc's objects end with Python's
    return code


class Workers:
    """Some workers, as many as command lines are carried out at a time. Close them at the end.

    Attributes
    ----------
    count : of command lines at a time
    fresh : whether each command line gets a process of its own: its processor time is then what a user's own run takes
    """

    def __init__(self, count: int, fresh: bool = False):
        self.count, self.fresh = count, fresh
        self._workers: list[Worker] = []

    def start(self, words: Sequence[str], log: Path) -> Worker:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`. Ended workers are replaced.

        Raises
        ------
        RuntimeError
            All are busy.
        """
        for free in [worker for worker in self._workers if not worker.busy]:
            with contextlib.suppress(ProcessEnded):  # a large one ends once it has answered
                if not self.fresh:
                    free.start(words, log)
                    return free
            free.stop()
            self._workers.remove(free)
        if len(self._workers) >= self.count:
            raise RuntimeError("all workers are busy")
        new = Worker()
        self._workers.append(new)
        new.start(words, log)
        return new

    def close(self) -> None:
        """End all processes."""
        for worker in self._workers:
            worker.stop()
        self._workers.clear()


def last_line(log: Path, beginning: str = "") -> str:
    """What a command line said last in its log, without its name; of the lines with this beginning."""
    try:
        with open(log, "rb") as file:
            file.seek(max(0, log.stat().st_size - TAIL))
            lines = [line for line in file.read().decode(errors="replace").splitlines() if line.strip()]
    except OSError:
        return ""
    return next((line.removeprefix("pdvol: ") for line in reversed(lines) if line.startswith(beginning)), "")
