"""A run's writer for all ranks: one of them writes, and keeps level_N.xdmf up to date where the run has it."""

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.errors import SimulationError
from pdvol.levels.script import Obstacle
from pdvol.parallel import on_root
from pdvol.registry import STUDIO
from pdvol.runs.stored_fields import SceneFields
from pdvol.scene import Scene
from pdvol.store.reader import Run, open_run
from pdvol.store.series import StepFields, nothing_more
from pdvol.store.writer import RunWriter

EXPORT_PAUSE = 20.0  # seconds before a run's first export of a running level, and between two of one level, at least
EXPORT_SHARE = 0.05  # of a level's time that its exports may take, at most


class Export:
    """level_N.xdmf of the levels being simulated, kept up to date for viewers and for runs that are killed. Used by
    rank 0.
    """

    def __init__(self, path: Path, scene: Scene, obstacles: Sequence[Obstacle]):
        self._path, self._scene, self._obstacles = path, scene, obstacles
        self._next: dict[int, float] = {}
        self._first = time.monotonic() + EXPORT_PAUSE

    def write(self, level: int) -> None:
        """Writes one level's, as far as it is."""
        begin, run = time.monotonic(), open_run(self._path)
        try:
            more: Callable[[int], StepFields] = SceneFields(self._scene, run, level, self._obstacles)
        except (ValueError, RuntimeError):  # a user's law may fail here alone, which must not stop the run
            more = nothing_more
        STUDIO["write_xdmf"](run, level, self._path / f"level_{level}.xdmf", more)
        now = time.monotonic()
        self._next[level] = now + max(EXPORT_PAUSE, (now - begin) / EXPORT_SHARE)

    def mend(self, level: int) -> None:
        """Writes one level's anew where its files are damaged."""
        if STUDIO["is_damaged_xdmf"](self._path / f"level_{level}.xdmf"):
            self.write(level)

    def follow(self, level: int) -> None:
        """The same after a state was stored, where the last export is old enough."""
        if time.monotonic() >= self._next.get(level, self._first):
            with suppress(SimulationError):  # a full disk is reported by the next state
                self.write(level)


class SharedWriter:
    """The run's writer on rank 0. All ranks call it together, and its errors are raised on all of them."""

    def __init__(self, comm: MPI.Comm, open_writer: Callable[[], RunWriter], exports: Sequence[Export]):
        self.comm, self._exports = comm, exports
        self._writer: Any = None  # a RunWriter on rank 0

        def take() -> None:
            self._writer = open_writer()

        on_root(comm, take)

    @property
    def path(self) -> Path:
        """The run folder; on rank 0."""
        return self._writer.path

    @cached_property
    def _run(self) -> Run:
        """What is stored; on rank 0."""
        return open_run(self.path)

    def call(self, name: str, *arguments: Any, **details: Any) -> Any:
        """The result of one of the writer's methods, on every rank. After a state was stored, level_N.xdmf follows if
        that is due.
        """

        def call() -> Any:
            result = getattr(self._writer, name)(*arguments, **details)
            if name == "write_state":
                for export in self._exports:
                    export.follow(arguments[0])
            return result

        return on_root(self.comm, call)

    def read(self, level: int, what: str, step: int) -> np.ndarray:
        """`positions` or `velocities` of a stored state, on every rank."""
        return on_root(self.comm, lambda: getattr(self._run.levels[level], what)(step))

    def record(self, level: int, step: int) -> dict:
        """The log's record of a stored step, on every rank; empty where there is none."""
        return on_root(self.comm, lambda: self._run.levels[level].record(step))

    def export(self, level: int) -> None:
        """Writes level_N.xdmf, where the run has it."""
        on_root(self.comm, lambda: self._write_exports(level))

    def finish(self, level: int) -> None:
        """Marks a level as done, with its export; where it is done, a damaged export is written anew."""

        def finish() -> None:
            if self._writer.info["levels"][level]["state"] != "done":
                self._write_exports(level)
                self._writer.set_level_state(level, "done")
            else:
                for export in self._exports:
                    export.mend(level)

        on_root(self.comm, finish)

    def _write_exports(self, level: int) -> None:
        for export in self._exports:
            export.write(level)

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
