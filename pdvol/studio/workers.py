"""Processes that have all libraries loaded and carry out one command line of `pdvol` after the other."""

import contextlib
import gc
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from pdvol.processes import Process, ProcessEnded

LOADED_BEFORE = ("pdvol.runs.runner", "pdvol.potentials.build")  # libraries that every run imports
TAIL = 8000  # bytes at the end of a log that are looked at for its last line
PATIENCE_OF_ABANDONED = 1.0  # seconds that a command line has to end after its interruption; its process is then ended
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
        code = import_module("pdvol.cli").run(words)
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
    """Some workers. One thread calls its methods. Close them at the end.

    Parameters
    ----------
    count : of command lines at a time, at most
    fresh : whether each command line gets a process of its own: its processor time is then what a user's own run takes
    ahead : processes that are kept started, so that their libraries are loaded when they are needed
    """

    def __init__(self, count: int = sys.maxsize, fresh: bool = False, ahead: int = 0):
        self.count, self._fresh, self._ahead = count, fresh, ahead
        self._workers: list[Worker] = []
        self._given_up: dict[Worker, float] = {}
        self._ending: list[threading.Thread] = []
        self.look()

    def start(self, words: Sequence[str], log: Path) -> Worker:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`. Of the workers that are not busy,
        the one that was started first is the one most likely loaded. Ended ones are replaced.

        Raises
        ------
        RuntimeError
            All are busy.
        """
        for free in [worker for worker in self._workers if not worker.busy]:
            with contextlib.suppress(ProcessEnded):  # a large one ends once it has answered
                if not self._fresh:
                    free.start(words, log)
                    return free
            self._end(free)
        if len(self._workers) >= self.count:
            raise RuntimeError("all workers are busy")
        self._workers.append(Worker())
        self._workers[-1].start(words, log)
        return self._workers[-1]

    def give_up(self, worker: Worker) -> None:
        """Interrupt a worker's command line where it has not ended."""
        if worker.busy:
            worker.interrupt()
            self._given_up[worker] = time.monotonic() + PATIENCE_OF_ABANDONED

    def look(self) -> None:
        """Take interrupted workers back, end those that do not follow, and start others in place of ended ones."""
        for worker, limit in list(self._given_up.items()):
            ended = worker.poll() is not None
            if ended or time.monotonic() >= limit:
                del self._given_up[worker]
                if not ended:
                    self._end(worker)
        self._workers = [worker for worker in self._workers if worker.busy or worker.alive]
        self._ending = [thread for thread in self._ending if thread.is_alive()]
        self._workers += [Worker() for _ in range(self._ahead - len(self._workers))]

    def close(self) -> None:
        """End all processes."""
        for worker in list(self._workers):
            self._end(worker)
        for thread in self._ending:
            thread.join()

    def _end(self, worker: Worker) -> None:
        self._workers.remove(worker)
        self._ending.append(threading.Thread(target=worker.stop, daemon=True))  # its end may take a while
        self._ending[-1].start()


def last_line(log: Path, beginning: str = "") -> str:
    """What a command line said last in its log, without its name; of the lines with this beginning."""
    try:
        with open(log, "rb") as file:
            file.seek(max(0, log.stat().st_size - TAIL))
            lines = [line for line in file.read().decode(errors="replace").splitlines() if line.strip()]
    except OSError:
        return ""
    return next((line.removeprefix("pdvol: ") for line in reversed(lines) if line.startswith(beginning)), "")
