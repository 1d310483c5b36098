"""Wedges on many machines: the same command lines as tasks of Dask, or printed for another engine."""

import contextlib
import shlex
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.processes import die_with_parent, without_launcher
from pdvol.studio.variations.executors import Workers
from pdvol.studio.variations.jobs import Executor, Job

CONNECT = 10.0  # seconds for the scheduler to answer
LOST = -9  # the exit code of a process that was killed: its job is started again
NOT_STARTED = 126  # the exit code that a shell gives for a command that it cannot carry out
PRINT = "print"


class Dask:
    """Tasks of a Dask scheduler. Scene, mesh files and the wedge's folder have the same paths on all machines.

    Parameters
    ----------
    address : of the scheduler, such as tcp://127.0.0.1:8786

    Raises
    ------
    InputError
        Dask is not installed, or no scheduler with workers answers there.
    """

    def __init__(self, address: str):
        try:
            from distributed import Client
        except ModuleNotFoundError as error:
            raise InputError("--executor dask needs Dask: pip install 'pdvol[farm]'") from error
        try:
            self._client = Client(address, timeout=CONNECT, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise InputError(
                f"--executor dask={address}: no scheduler answers there ({' '.join(str(error).split())})"
            ) from error
        if not self.count:
            self._client.close()
            raise InputError(
                f"--executor dask={address}: the scheduler has no workers; start some: dask worker {address}"
            )

    @property
    def count(self) -> int:
        """Command lines at a time: threads of all workers now."""
        return sum(self._client.nthreads().values())

    def start(self, words: Sequence[str], log: Path) -> "Task":
        """Carry out `pdvol` with these words; what it prints goes to the file `log`."""
        return Task(self._client.submit(carry_out, [str(word) for word in words], str(log), pure=False), log)

    def close(self) -> None:
        """Leave the scheduler."""
        self._client.close()


class Task:
    """A command line that a worker of Dask carries out."""

    def __init__(self, future: Any, log: Path):
        self._future, self._log = future, log

    def poll(self) -> int | None:
        """Its exit code; None while it is carried out. A task that was lost with its workers counts as killed. What
        a worker cannot even start has failed, and the log has the reason.
        """
        from distributed import KilledWorker

        if not self._future.done():
            return None
        if self._future.status == "finished":
            return int(self._future.result())
        error = self._future.exception() if self._future.status == "error" else None
        if error is None or isinstance(error, KilledWorker):
            return LOST
        with contextlib.suppress(OSError):
            self._log.write_text(f"a worker of Dask could not start it: {' '.join(str(error).split())}\n")
        return NOT_STARTED

    def stop(self) -> None:
        """Do not carry it out. What has begun ends by itself."""
        with contextlib.suppress(Exception):  # the scheduler may be gone
            self._future.cancel(force=True)


def carry_out(words: Sequence[str], log: str) -> int:
    """On a worker: carry out `pdvol` with these words in a process of its own; returns its exit code."""
    with open(log, "w") as output:
        return subprocess.run(
            [sys.executable, "-m", "pdvol", *words],
            env=without_launcher(),
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=output,
            preexec_fn=die_with_parent,
            check=False,
        ).returncode


def command_line(job: Job) -> str:
    """A job as one line for a shell."""
    return shlex.join(["pdvol", *job.command()])


def chosen_executor(text: str, jobs: int) -> Executor | None:
    """What `--executor` names: `local` and `dask=ADDRESS`; None for `print`.

    Raises
    ------
    InputError
        It is none of these, or cannot be reached.
    """
    name, _, address = text.partition("=")
    if text == "local":
        return Workers(jobs)
    if name == "dask" and address:
        return Dask(address)
    if text == PRINT:
        return None
    raise InputError(f"--executor {text}: choose local, dask=tcp://HOST:PORT or print")
