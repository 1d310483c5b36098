"""How far a level is: a bar with the time left in a notebook and on a terminal, a plain line per step anywhere else."""

import math
import sys
import warnings
from collections.abc import Callable, Mapping
from typing import Any, TextIO

from mpi4py import MPI
from tqdm import tqdm

from pdvol.parallel import on_root


class Progress:
    """Progress of one level.

    Parameters
    ----------
    level : int
    total : int
        Steps of the whole level.
    stream : text stream
        Standard error when None; a notebook then gets its own kind of bar.
    done : int
        Steps that were stored before, of a resumed level.
    """

    def __init__(self, level: int, total: int, stream: TextIO | None = None, done: int = 0):
        self.level, self.total = level, total
        self.stream = sys.stderr if stream is None else stream
        self._bar: tqdm | None = None
        notebook = stream is None and in_notebook()
        if notebook or self.stream.isatty():
            kind = _notebook_bar() if notebook else tqdm
            self._bar = kind(
                total=total, initial=done, desc=f"level {level}", unit="step", file=self.stream, dynamic_ncols=True
            )

    def step(self, record: Mapping) -> None:
        """Shows one finished step; `record` is its object in the log. Numbers it lacks are left out."""
        if self._bar is None:
            self.stream.write(step_line(record, self.level, self.total) + "\n")
            self.stream.flush()
            return
        shown = {"newton": record.get("newton_iterations"), "contacts": record.get("contacts")}
        self._bar.set_postfix({key: value for key, value in shown.items() if value is not None}, refresh=False)
        self._bar.update()

    def close(self) -> None:
        """Leave the bar as it stands."""
        if self._bar is not None:
            self._bar.close()


class Calls(Progress):
    """Calls a user's function with the log record of each finished step. Made and used by all ranks; rank 0 calls."""

    def __init__(self, function: Callable[[dict], Any], comm: MPI.Comm):
        self._function, self._comm = function, comm

    def step(self, record: Mapping) -> None:
        """Calls the function on rank 0. Collective."""
        on_root(self._comm, lambda: self._call(dict(record)))

    def _call(self, record: dict) -> None:
        self._function(record)

    def close(self) -> None:
        """Does nothing."""


def in_notebook() -> bool:
    """Whether an IPython kernel runs this: a notebook, or a console that shows the same."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


def _notebook_bar() -> Callable:
    """tqdm's bar for notebooks: a widget where ipywidgets is installed, text where not."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that there are no widgets, or that tqdm.auto is experimental
        from tqdm.auto import tqdm as bar
    return bar


def step_line(record: Mapping, level: int, total: int) -> str:
    """One step as a line: `level 1  step  12/100  newton 4  contacts 37  gap 1.2e-04  0.31 s`."""
    parts = [f"level {level}", f"step {record['step']:>{len(str(total))}}/{total}"]
    shown = (
        ("newton", "newton_iterations", "d"),
        ("contacts", "contacts", "d"),
        ("gap", "min_gap", ".1e"),
        ("intersections", "intersections", "d"),
    )
    for label, key, pattern in shown:
        value = record.get(key)
        if value is not None and math.isfinite(value):
            parts.append(f"{label} {format(value, pattern)}")
    seconds = record.get("seconds")
    total_seconds = seconds.get("total") if isinstance(seconds, Mapping) else seconds
    if total_seconds is not None:
        parts.append(f"{total_seconds:.2f} s")
    return "  ".join(parts)
