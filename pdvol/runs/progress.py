"""How far a level is: a bar with the time left on a terminal, one plain line per step anywhere else."""

import math
import sys
from collections.abc import Mapping
from typing import TextIO

from tqdm import tqdm


class Progress:
    """Progress of one level.

    Parameters
    ----------
    level : int
    total : int
        Steps of the whole level.
    stream : text stream
        Standard error when None.
    done : int
        Steps that were stored before, of a resumed level.
    """

    def __init__(self, level: int, total: int, stream: TextIO | None = None, done: int = 0):
        self.level, self.total = level, total
        self.stream = sys.stderr if stream is None else stream
        self._bar = None
        if self.stream.isatty():
            self._bar = tqdm(
                total=total, initial=done, desc=f"level {level}", unit="step", file=self.stream, dynamic_ncols=True
            )

    def step(self, record: Mapping) -> None:
        """Tell of one finished step; `record` is its object in the log. Numbers it lacks are left out."""
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


def step_line(record: Mapping, level: int, total: int) -> str:
    """One step as a line: `level 1  step  12/100  newton 4  contacts 37  gap 1.2e-04  0.31 s`."""
    parts = [f"level {level}", f"step {record['step']:>{len(str(total))}}/{total}"]
    told = (
        ("newton", "newton_iterations", "d"),
        ("contacts", "contacts", "d"),
        ("gap", "min_gap", ".1e"),
        ("intersections", "intersections", "d"),
    )
    for label, key, pattern in told:
        value = record.get(key)
        if value is not None and math.isfinite(value):
            parts.append(f"{label} {format(value, pattern)}")
    seconds = record.get("seconds")
    total_seconds = seconds.get("total") if isinstance(seconds, Mapping) else seconds
    if total_seconds is not None:
        parts.append(f"{total_seconds:.2f} s")
    return "  ".join(parts)
