"""What a function returns on several numbers of ranks: on one in this process, on more in ranks that wait
for calls.

`mpirun -n RANKS python on_ranks.py FOLDER PID` carries out the calls of the process PID, which come as files: starting
ranks takes longer than most of the calls.
"""

import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np
from mpi4py import MPI

from commands import SAFETY

POLL_SECONDS, MOST_POLL_SECONDS = 0.02, 0.5  # between looks for a file, at first and after long
ENVIRONMENT = {
    "OMP_NUM_THREADS": "1",
    "OMPI_MCA_mpi_yield_when_idle": "1",  # or a busy machine spends its time on ranks that spin
    "OMPI_MCA_rmaps_base_oversubscribe": "1",
    "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
}


def results_on(counts: tuple[int, ...], function: Callable, *arguments) -> list:
    """The arrays by name that `function(comm, *arguments)` of a module returns on rank 0, for each number of ranks.
    Skips where nothing starts several.
    """
    returned = [
        function(MPI.COMM_SELF, *arguments) if count == 1 else ranks(count).call(function, arguments)
        for count in counts
    ]
    return [{name: np.asarray(value) for name, value in found.items()} for found in returned]


def ranks(count: int) -> "Ranks":
    """The processes that wait, started where there are none yet."""
    if count not in RUNNING:
        RUNNING[count] = Ranks(count)
    return RUNNING[count]


class Ranks:
    """Processes under one mpirun that carry out calls, as long as none of them fails."""

    def __init__(self, count: int):
        import pytest

        mpirun = shutil.which("mpirun") or pytest.skip("there is no mpirun")
        self.count, self.calls = count, 0
        self.folder = Path(tempfile.mkdtemp(prefix="ranks-"))
        self.output = self.folder / "output"
        words = [mpirun, "-n", str(count), sys.executable, __file__, str(self.folder), str(os.getpid())]
        with self.output.open("w") as file:
            self.process = subprocess.Popen(words, env={**os.environ, **ENVIRONMENT}, stdout=file, stderr=file)

    def call(self, function: Callable, arguments: tuple):
        """What the function returns on rank 0."""
        call, result = files_of(self.folder, self.calls)
        self.calls += 1
        write(call, (self.count, sys.path, function.__module__, function.__qualname__, arguments))
        end = time.monotonic() + SAFETY
        while not result.exists():
            if self.process.poll() is not None or time.monotonic() > end:
                said = self.output.read_text()
                self.process.kill()
                self.end()
                raise AssertionError(f"the ranks ended, or take too long: {said}")
            time.sleep(POLL_SECONDS)
        return pickle.loads(result.read_bytes())

    def end(self) -> None:
        """Ends the processes; the next call starts others."""
        RUNNING.pop(self.count)
        (self.folder / "end").touch()
        self.process.wait(SAFETY)
        shutil.rmtree(self.folder, ignore_errors=True)


RUNNING: dict[int, Ranks] = {}
"""The processes of each number of ranks."""


def end_all() -> None:
    """Ends the processes of all numbers of ranks."""
    for running in list(RUNNING.values()):
        running.end()


def files_of(folder: Path, number: int) -> tuple[Path, Path]:
    """A call, and its result."""
    return folder / f"{number}.call", folder / f"{number}.result"


def write(path: Path, content: object) -> None:
    """A file that is whole as soon as it is there."""
    aside = path.with_suffix(".part")
    aside.write_bytes(pickle.dumps(content))
    aside.rename(path)


def lives(process: int) -> bool:
    """Whether there is a process of this number."""
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


def carry_out(folder: Path, caller: int) -> None:
    """Carries out calls on this rank until the caller has ended; an error ends all ranks."""
    comm, number, pause = MPI.COMM_WORLD, 0, POLL_SECONDS
    while lives(caller) and not (folder / "end").exists():
        call, result = files_of(folder, number)
        if not call.exists():
            time.sleep(pause)
            pause = min(1.1 * pause, MOST_POLL_SECONDS)
            continue
        try:
            count, sys.path[:], module, name, arguments = pickle.loads(call.read_bytes())
            if comm.size != count:
                raise RuntimeError(f"{comm.size} ranks, not {count}")
            returned = getattr(import_module(module), name)(comm, *arguments)
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
            comm.Abort(1)
        if comm.rank == 0:
            write(result, returned)
        number, pause = number + 1, POLL_SECONDS


if __name__ == "__main__":
    carry_out(Path(sys.argv[1]), int(sys.argv[2]))
