"""A run's writer for all ranks: one of them writes."""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from pdvol.parallel import on_root
from pdvol.store.reader import Run, open_run
from pdvol.store.writer import RunWriter


class SharedWriter:
    """The run's writer on rank 0. All ranks call it together, and its errors are raised on all of them; `call("steps",
    level)` gives the number of stored states.
    """

    def __init__(self, comm: MPI.Comm, open_writer: Callable[[], RunWriter]):
        self.comm = comm
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
        """The result of one of the writer's methods, on every rank."""
        return on_root(self.comm, lambda: getattr(self._writer, name)(*arguments, **details))

    def read(self, level: int, what: str, step: int) -> np.ndarray:
        """`positions` or `velocities` (n, d) of a stored state, on every rank."""
        return on_root(self.comm, lambda: getattr(self._run.levels[level], what)(step))

    def record(self, level: int, step: int) -> dict:
        """The log's record of a stored step, on every rank; empty where there is none."""
        return on_root(self.comm, lambda: self._run.levels[level].record(step))

    def close(self) -> None:
        if self._writer is not None:
            self._writer.close()
