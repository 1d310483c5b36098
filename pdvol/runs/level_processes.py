"""Levels in processes of their own: on several MPI ranks each, and side by side where that is wanted.

A step needs the coarser level's states up to the same step only (docs/method.md), so that levels side by side are a
few steps behind each other. The keeper, which is the process that writes the run folder, starts each level's processes.
Their first rank sends it states and requests through a FIFO, and reads the coarser level's states in the folder.
"""

import io
import os
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import nullcontext, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, TextIO, cast

import numpy as np
from mpi4py import MPI

from pdvol.errors import InputError, PdvolError, SimulationError
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.partition import carried
from pdvol.parallel import on_root
from pdvol.processes import PATIENCE, die_with_parent, give_memory_back, without_launcher
from pdvol.runs.launcher import rank_command
from pdvol.runs.level_run import Watch, run_level
from pdvol.runs.progress import Calls, Progress
from pdvol.runs.scene_file import stored_shot
from pdvol.runs.shared_writer import SharedWriter
from pdvol.runs.stage_lines import StageLines
from pdvol.stages import reported_to, stage
from pdvol.store.reader import Run, open_run

LOWEST = 19  # nice value of Linux: the lowest priority
POLL = 0.005  # seconds between checks for a coarser state
CHECK = 0.5  # seconds between checks whether a process that sends nothing has ended
START_TIME = 120.0  # seconds that processes may need to load the libraries; 2 to 4 are usual
SIGNALLED = 128  # without a unit: shells and Open MPI add it to the number of the signal that ended a process


class NoRanks(SimulationError):
    """The ranks of a level did not start."""


class Follower(SharedWriter):
    """A level's writer in its processes: the first rank sends states to the keeper, and reads those that are stored."""

    def __init__(self, run: Run, keeper: Connection | None, comm: MPI.Comm):
        self._run, self._keeper, self.comm, self._parent = run, keeper, comm, os.getppid()

    def send(self, *message: Any) -> None:
        if self._keeper is not None:
            self._keeper.send(message)

    def call(self, name: str, *arguments: Any, **details: Any) -> Any:
        """The number of stored states, or a request to the keeper."""
        if name == "steps":
            return on_root(self.comm, lambda: self._run.levels[arguments[0]].steps)
        return self.send("call", name, arguments, details)

    def read(self, level: int, what: str, step: int) -> np.ndarray:
        """`positions` or `velocities` of a stored state; waits for one not stored yet while the keeper runs."""
        stored = self._run.levels[level]

        def read() -> np.ndarray:
            while stored.steps <= step:
                if os.getppid() != self._parent:
                    raise SimulationError(f"level {level}, step {step}: nobody keeps the run any more")
                time.sleep(POLL)
            return getattr(stored, what)(step)

        return on_root(self.comm, read)

    def watch(self, level: int, total: int, done: int) -> Progress:
        """Has the keeper show the level's progress, by the states that it stores."""
        self.send("watch", total, done)
        return Calls(lasts=lambda record: self.send("lasts", record))


class _Sent(io.TextIOBase):
    """What a level's processes write for the user, sent to the keeper, whose standard error may be a terminal."""

    def __init__(self, send: Callable[..., None], terminal: bool):
        self._send, self._terminal = send, terminal

    def write(self, text: str) -> int:
        self._send("say", text)
        return len(text)

    def isatty(self) -> bool:
        return self._terminal


def march_levels(writer: SharedWriter, levels: Mapping[int, int], progress: Watch | None = None) -> None:
    """Runs levels of an opened run side by side, each in processes of its own, and stores what they report.

    Parameters
    ----------
    writer : the run's writer, as `run_level` takes it
    levels : the number of ranks of each level
    progress : as `Execution` has it

    Raises
    ------
    NoRanks
        Those of a level did not start.
    SimulationError
        A level could not go on. Coarser levels are finished, finer ones are interrupted, all steps are kept.
    """
    give_memory_back()  # of the levels' preparation, for the processes
    workers = {level: _Worker(writer.path, level, ranks, len(levels) == 1) for level, ranks in levels.items()}
    for level, ranks in levels.items():
        if progress is not None and ranks > 1:
            print(f"level {level}: {ranks} ranks (--ranks N for another number)", file=sys.stderr)
    watches: dict[int, Progress] = {level: Calls() for level in levels}
    failed: dict[int, PdvolError] = {}
    try:
        with stage("starting " + ", ".join(f"level {level}" for level in levels)):
            end = time.monotonic() + START_TIME
            for worker in workers.values():
                worker.await_start(end)
        while workers:
            ready = wait([worker.reports for worker in workers.values()], CHECK)
            for level, worker in list(workers.items()):
                if level not in workers or (worker.reports not in ready and worker.runs):
                    continue  # the first: ended by a coarser one just now
                match worker.message():
                    case ("ended",):
                        del workers[level]
                        if (error := worker.end()) is not None:
                            failed.setdefault(level, error)
                    case "error", error:
                        failed[level] = error
                        for finer in [other for other in workers if other > level]:
                            workers.pop(finer).stop()
                            writer.call("set_level_state", finer, "interrupted")
                    case "say", text:
                        sys.stderr.write(text)
                        sys.stderr.flush()
                    case "watch", total, done if progress is not None:
                        watches[level] = progress(level, total, done)
                    case "lasts", record:
                        watches[level].lasts(record)
                    case "call", name, arguments, details:
                        writer.call(name, *arguments, **details)
                        if name == "write_state" and isinstance(arguments[-1], dict):
                            watches[level].step(arguments[-1])
    finally:
        for worker in workers.values():
            worker.stop()
        for watch in watches.values():
            watch.close()
    if failed:
        raise failed[min(failed)]


class _Worker:
    """The processes that march one level; `reports` receives the messages of their first rank."""

    def __init__(self, path: Path, level: int, ranks: int, alone: bool):
        self._level, self._ranks = level, ranks
        self._folder = tempfile.TemporaryDirectory(prefix="pdvol-")
        fifo, self._output = Path(self._folder.name, "reports"), Path(self._folder.name, "output")
        os.mkfifo(fifo)
        handle = os.open(fifo, os.O_RDONLY | os.O_NONBLOCK)  # or it would wait for the one who writes
        os.set_blocking(handle, True)
        self.reports = Connection(handle, writable=False)
        # On a terminal the bars of several levels are there at once, and lines would tear them apart.
        lines = ("terminal" if alone else "none") if sys.stderr.isatty() else "log"
        words = [sys.executable, "-m", __name__, str(path), str(level), str(ranks), str(fifo), lines]
        command, env = rank_command(ranks) if ranks > 1 else ([], without_launcher())
        with self._output.open("wb") as output:
            # A session of its own: Ctrl-C is for the process that keeps the folder.
            self._process = subprocess.Popen(
                [*command, *words],
                env=env,
                stdin=subprocess.DEVNULL,
                stderr=output if ranks > 1 else None,  # a launcher describes a rank's end in many lines
                start_new_session=True,
                preexec_fn=die_with_parent,
            )

    @property
    def runs(self) -> bool:
        """Whether its processes run."""
        return self._process.poll() is None

    def await_start(self, end: float) -> None:
        """Waits for the first message, until the time `end`; NoRanks where several ranks do not send it."""
        while not self.reports.poll(CHECK):
            said = ""
            if not self.runs:
                if self._ranks == 1 or self.reports.poll():
                    return
                lines = [line for line in self._output.read_text(errors="replace").splitlines() if line.strip(" -*")]
                said = f": {lines[0].strip()}" if lines else ""
            elif time.monotonic() < end:
                continue
            raise NoRanks(f"level {self._level}: {self._ranks} ranks did not start{said}")

    def message(self) -> tuple:
        """The next message; "ended" where none will come."""
        try:
            if self.reports.poll() or self.runs:
                return self.reports.recv()
        except (EOFError, OSError):
            pass
        return ("ended",)

    def end(self) -> SimulationError | None:
        """Waits for the end after the last message; the error where it was not a good one."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(PATIENCE)
        said = self._output.read_text(errors="replace")
        if "Traceback" in said:
            sys.stderr.write(said)
        status = self.stop()
        if status == 0:
            return None
        plain = self._ranks > 1 and status > 1 and MPI.get_vendor()[0] == "MPICH"  # its launcher adds nothing
        signal = -status if status < 0 else status - SIGNALLED * (not plain)
        how = f" was ended by signal {signal}" if 0 < signal < SIGNALLED / 2 else f" ended with status {status}"
        what = "one of its ranks" if self._ranks > 1 else "its process"
        return SimulationError(f"level {self._level}: {what}{how}; finished steps are kept, go on with --resume")

    def stop(self) -> int:
        """Ends the processes, and returns the status. A launcher gets time to remove what its ranks share."""
        if self.runs and self._ranks > 1:
            self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(PATIENCE)
        self._process.kill()
        status = self._process.wait()
        self.reports.close()
        self._folder.cleanup()
        return status


def _work(path: str, level: int, ranks: int, fifo: str, lines: str) -> None:
    """Marches one level in this process, one rank of several perhaps."""
    comm, keeper = MPI.COMM_WORLD, None
    die_with_parent()
    if comm.rank == 0:
        keeper = Connection(os.open(fifo, os.O_WRONLY), readable=False)
        keeper.send(("ready",))
    else:
        sys.stdout = open(os.devnull, "w")  # what a scene file prints comes once
    try:
        if comm.size != ranks:
            raise InputError(f"the MPI launcher started programs of {comm.size} rank each; use --ranks 1")
        _march(open_run(path), level, keeper, comm, lines)
    except PdvolError as error:
        if keeper is not None:
            keeper.send(("error", error))
    except BrokenPipeError:  # the keeper has ended and takes no report
        comm.Abort(1)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        comm.Abort(1)
    if keeper is not None:
        keeper.close()


def _march(run: Run, level: int, keeper: Connection | None, comm: MPI.Comm, lines: str) -> None:
    info = run.info
    if level and info.get("channel"):  # a hand waits for level 0 and its picture
        with suppress(OSError):  # where Linux weighs sessions
            Path("/proc/self/autogroup").write_text(str(os.nice(LOWEST)))
    writer = Follower(run, keeper, comm)
    shown = keeper is not None and lines != "none"
    with reported_to(StageLines(cast(TextIO, _Sent(writer.send, lines == "terminal")))) if shown else nullcontext():
        shot = stored_shot(info, trusted=True)  # the keeper has just run it
        meshes = [stored.mesh for stored in run.levels[: level + 1]]
        places = on_root(comm, lambda: _places(run, level, shot.scene.steps)) if level and comm.size > 1 else None
        hierarchy = Hierarchy(meshes, comm, info["prolongation"], places)
        model = level_model(shot.scene, hierarchy, level, info["diagonal"], placed_obstacles(shot.scene.obstacles))
        give_memory_back()
        run_level(model, hierarchy, info["method"], writer, writer.watch)


def _places(run: Run, level: int, steps: int) -> np.ndarray | None:
    """(n, d) [m]: about where vertices will be when most touch, by the finished level below; None where none do."""
    below = run.levels[level - 1]
    contacts = [record["contacts"] for record in below.log if "contacts" in record]
    if below.steps <= steps or not any(contacts):
        return None
    most = next(record["step"] for record in below.log if record.get("contacts") == max(contacts))
    return carried(below.mesh, below.positions(most), run.levels[level].mesh)


if __name__ == "__main__":
    _work(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4], sys.argv[5])
    if MPI.COMM_WORLD.size == 1:  # at once: at low priority Python's shutdown may last longer than the parent waits
        sys.stdout.flush()
        os._exit(0)
