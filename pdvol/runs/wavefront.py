"""Levels side by side: one process a level, each a few steps behind the coarser one, whose states it reads from the run
folder.

A step needs the coarser level's states up to the same step only (design, section 2). This process writes the folder:
workers send it their states, and read their coarser level's there. The results are those of one level after the other.
"""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import nullcontext
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.errors import PdvolError, SimulationError
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import hierarchy_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.processes import die_with_parent, without_launcher
from pdvol.runs.level_run import Watch, run_level
from pdvol.runs.scene_file import stored_shot
from pdvol.runs.shared_writer import SharedWriter
from pdvol.runs.stage_lines import StageLines
from pdvol.stages import reported_to
from pdvol.store.reader import Run, open_run

POLL = 0.005  # seconds between checks for a coarser state
WORKER_GRACE_TIME = 10.0  # seconds that a worker has to end before it is killed


class Follower:
    """A level's writer in a worker: it sends states to the keeper of the folder, and waits for those it reads."""

    def __init__(self, run: Run, keeper: Connection):
        self.run, self._keeper, self._parent = run, keeper, os.getppid()

    def call(self, name: str, *arguments: Any, **details: Any) -> Any:
        """The number of stored states, or a request to the keeper."""
        if name == "steps":
            return self.run.levels[arguments[0]].steps
        return self._keeper.send(("call", (name, *arguments), details))

    def read(self, level: int, what: str, step: int) -> np.ndarray:
        """`positions` or `velocities` of a stored state; it waits for one that is not stored yet, as long as the keeper
        runs.
        """
        stored = self.run.levels[level]
        while stored.steps <= step:
            if os.getppid() != self._parent:
                raise SimulationError(f"level {level}, step {step}: nobody keeps the run any more")
            time.sleep(POLL)
        return getattr(stored, what)(step)

    def record(self, level: int, step: int) -> dict:
        """The log's record of a stored step; empty where there is none."""
        return next((r for r in self.run.levels[level].log if r["step"] == step), {})

    def export(self, level: int) -> None:
        """Asks for level_N.xdmf."""
        self._keeper.send(("export", (level,), {}))

    def finish(self, level: int) -> None:
        """Reports that a level is done."""
        self._keeper.send(("finish", (level,), {}))


def march_levels(writer: SharedWriter, levels: Sequence[int], steps: int, progress: Watch | None = None) -> None:
    """Runs levels of an opened run side by side and stores what they report.

    Parameters
    ----------
    writer : the run's writer, as `run_level` takes it
    levels : coarsest first
    steps : of the scene
    progress : as `run_scene` takes it

    Raises
    ------
    SimulationError
        A level could not go on. Coarser levels are finished, finer ones are interrupted, all steps are kept.
    """
    workers = {level: _Worker(writer.path, level) for level in levels}
    watches = (
        {level: progress(level, steps, max(0, writer.call("steps", level) - 1)) for level in levels} if progress else {}
    )
    failed: dict[int, PdvolError] = {}
    try:
        while workers:
            ready = wait([worker.reports for worker in workers.values()])
            for level in [level for level, worker in workers.items() if worker.reports in ready]:
                if level not in workers:  # ended by a coarser one just now
                    continue
                try:
                    name, arguments, details = workers[level].reports.recv()
                except (EOFError, OSError):
                    name, arguments = "ended", (workers[level].end(),)
                if name == "ended":
                    del workers[level]
                    if arguments[0] and level not in failed:
                        failed[level] = SimulationError(f"level {level}: its process ended with status {arguments[0]}")
                elif name == "error":
                    failed[level] = arguments[0]
                    for finer in [other for other in workers if other > level]:
                        workers.pop(finer).stop()
                        writer.call("set_level_state", finer, "interrupted")
                else:
                    getattr(writer, name)(*arguments, **details)
                    if arguments[0] == "write_state" and level in watches and isinstance(arguments[-1], dict):
                        watches[level].step(arguments[-1])
    finally:
        for worker in workers.values():
            worker.stop()
        for watch in watches.values():
            watch.close()
    if failed:
        raise failed[min(failed)]


class _Worker:
    """A process that marches one level; `reports` receives its messages."""

    def __init__(self, path: Path, level: int):
        self.reports, theirs = Pipe(duplex=False)
        # A session of its own: Ctrl-C is for the process that keeps the folder.
        self._process = subprocess.Popen(
            [sys.executable, "-m", __name__, str(path), str(level), str(theirs.fileno())],
            env=without_launcher(),
            stdin=subprocess.DEVNULL,
            pass_fds=[theirs.fileno()],
            start_new_session=True,
            preexec_fn=die_with_parent,
        )
        theirs.close()

    def end(self) -> int:
        """Its exit status, after its last message."""
        self.reports.close()
        try:
            return self._process.wait(WORKER_GRACE_TIME)
        except subprocess.TimeoutExpired:
            self._process.kill()
            return self._process.wait()

    def stop(self) -> None:
        """Ends it."""
        self._process.kill()
        self._process.wait()
        self.reports.close()


def _work(path: str, level: int, handle: int) -> None:
    keeper = Connection(handle, readable=False)
    try:
        run = open_run(path)
        info = run.info
        shot = stored_shot(info)
        hierarchy = Hierarchy([stored.mesh for stored in run.levels[: level + 1]], MPI.COMM_SELF, info["prolongation"])
        model = hierarchy_model(shot.scene, hierarchy, level, info["diagonal"], placed_obstacles(shot.scene.obstacles))
        # On a terminal the bars of all levels are there at once, and lines would tear them apart.
        with nullcontext() if sys.stderr.isatty() else reported_to(StageLines()):
            run_level(model, hierarchy, info["method"], Follower(run, keeper), None)
    except PdvolError as error:
        keeper.send(("error", (error,), {}))
    except BrokenPipeError:  # the keeper has ended and takes no report
        return
    keeper.close()


if __name__ == "__main__":
    _work(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
