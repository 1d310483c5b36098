"""Processes that have all libraries loaded and carry out one command line of `pdvol` after the other."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import IO, cast

from pdvol.processes import die_with_parent, without_launcher

TAIL = 8000  # bytes at the end of a log that are looked at for its last line
PATIENCE = 5.0  # seconds that a process has to end after the request; it stores a state in less


class WorkerEnded(RuntimeError):
    """A worker's process has ended, as it does when it has become large."""


class Worker:
    """One process. It starts at once; libraries are loaded while the caller goes on: these modules, or those of a run.

    Attributes
    ----------
    busy : whether a command line is carried out
    """

    def __init__(self, *modules: str) -> None:
        self.busy = False
        self._answers = b""
        self._paused = False
        self._process = subprocess.Popen(
            [sys.executable, "-m", "pdvol.worker", *modules],
            env=without_launcher(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for the process that keeps the runs
            preexec_fn=die_with_parent,
        )
        self._commands = cast(IO[bytes], self._process.stdin)
        self._output = cast(IO[bytes], self._process.stdout)
        os.set_blocking(self._output.fileno(), False)

    @property
    def process(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process can take another command line."""
        return self._process.poll() is None

    def start(self, words: Sequence[str], log: Path) -> None:
        """Carry out `pdvol` with these words; what it prints goes to the file `log`.

        Raises
        ------
        RuntimeError
            It is busy.
        WorkerEnded
            It has ended, perhaps just now.
        """
        if self.busy:
            raise RuntimeError("a worker carries out one command line at a time")
        if not self.alive:
            raise WorkerEnded("the worker has ended")
        line = json.dumps({"words": [str(word) for word in words], "log": str(log)}) + "\n"
        try:
            self._commands.write(line.encode())
            self._commands.flush()
        except OSError as error:
            raise WorkerEnded("the worker has ended") from error
        self.busy = True

    def poll(self) -> int | None:
        """The exit code of the command line; None while it is carried out.

        A negative number is the signal that has ended the process before the command line had.
        """
        if not self.busy:
            return None
        with contextlib.suppress(BlockingIOError):
            while read := os.read(self._output.fileno(), 65536):
                self._answers += read
        *lines, self._answers = self._answers.split(b"\n")
        for line in lines:
            answer = json.loads(line)
            if "code" in answer:
                self.busy = False
                return int(answer["code"])
        code = self._process.poll()
        if code is None:
            return None
        self.busy = False
        return code if code < 0 else -signal.SIGKILL

    def interrupt(self) -> None:
        """Ask the command line to end, as Ctrl-C does: its exit code is then 130, and the process takes the next one.

        It may not follow, as long as it loads libraries or is in code that is not Python.
        """
        self.resume()
        if self.busy:
            self._signal(signal.SIGINT)

    def pause(self) -> None:
        """Hold the process until `resume`."""
        self._signal(signal.SIGSTOP)
        self._paused = True

    def resume(self) -> None:
        """Go on after `pause`."""
        self._signal(signal.SIGCONT)
        self._paused = False

    @property
    def paused(self) -> bool:
        """Whether `pause` holds it."""
        return self._paused and self.alive

    def stop(self) -> None:
        """End the process. States that a run has stored are whole."""
        self.resume()
        with contextlib.suppress(OSError):
            self._commands.close()
        if self.busy:
            self._signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        self._process.kill()
        self._process.wait()
        self._output.close()
        self.busy = False

    def _signal(self, number: int) -> None:
        self._process.send_signal(number)  # not os.kill: another process may have the number of one that has ended


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
            with contextlib.suppress(WorkerEnded):  # a large one ends once it has answered
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
