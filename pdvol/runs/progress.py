"""How far a level is: a bar with the time left in a notebook and on a terminal, a plain line per step anywhere else."""

import math
from collections.abc import Callable, Mapping
from typing import TextIO

from tqdm import tqdm

from pdvol.runs.notebook_text import progress_stream
from pdvol.runs.stage_lines import SO_FAR, duration, real_time

LABELS = (
    ("newton", "newton_iterations", "d"),
    ("contacts", "contacts", "d"),
    ("gap", "min_gap", ".1e"),
    ("intersections", "intersections", "d"),
)
"""What is shown of a record: label, key, pattern."""
BAR = ("newton", "contacts")  # what a bar shows of a finished step, for want of space


Call = Callable[[Mapping], object]
"""Of a record of the log."""


class Progress:
    """Progress of one level.

    Parameters
    ----------
    total : steps of the whole level
    done : steps that were stored before, of a resumed level
    stream : `progress_stream()` when None
    """

    def __init__(self, level: int, total: int, done: int = 0, stream: TextIO | None = None):
        self.level, self.total = level, total
        self.stream = progress_stream() if stream is None else stream
        self._bar: tqdm | None = None
        self._shown = (0, 0.0)
        self._last, self._shot, self._spent = done, 0.0, 0.0  # s of the shot and of computing up to the last step seen
        if self.stream.isatty():
            self._bar = tqdm(
                total=total, initial=done, desc=f"level {level}", unit="step", file=self.stream, dynamic_ncols=True
            )

    def step(self, record: Mapping) -> None:
        """Shows one finished step; `record` is its object in the log. Numbers it lacks are left out."""
        self._last = record["step"]
        if "time" in record:
            self._shot += record["time"] / record["step"]
            self._spent += record["seconds"]["total"]
        if self._bar is None:
            self._write(step_line(record, self.level, self.total))
            return
        self._bar.set_postfix({k: v for k, v in _shown(record).items() if k in BAR}, refresh=False)
        self._bar.update()

    def lasts(self, record: Mapping) -> None:
        """Shows how far a step is that lasts; `record` is what its object in the log would have so far. Lines come ever
        less often: each after twice the time of the one before.
        """
        if self._bar is not None:
            self._bar.set_postfix({"step": record["step"], **_shown(record)})
            return
        step, seconds = record["step"], record["seconds"]["total"]
        if step != self._shown[0] or seconds >= 2.0 * self._shown[1]:
            self._shown = step, seconds
            self._write(f"{step_line(record, self.level, self.total)} {SO_FAR}")

    def _write(self, line: str) -> None:
        self.stream.write(line + "\n")
        self.stream.flush()

    def close(self) -> None:
        """Leave the bar as it stands, and say how fast the steps of a finished level were."""
        if self._bar is not None:
            self._bar.close()
        if self._spent and self._last == self.total:
            factor = real_time(self._shot, self._spent)
            self._write(f"level {self.level}: {self._shot:.3g} s of the shot in {duration(self._spent, 2)}, {factor}")


class Calls(Progress):
    """Calls functions with the log's record of each finished step, and with what it is so far of one that lasts."""

    def __init__(self, step: Call = lambda record: None, lasts: Call = lambda record: None):
        self._step, self._lasts = step, lasts

    def step(self, record: Mapping) -> None:
        self._step(record)

    def lasts(self, record: Mapping) -> None:
        self._lasts(record)

    def close(self) -> None:
        """Does nothing."""


def _shown(record: Mapping) -> dict[str, str]:
    """What people see of a record, by label; what it lacks, or what is not finite, is left out."""
    found = ((label, record.get(key), pattern) for label, key, pattern in LABELS)
    return {label: format(value, p) for label, value, p in found if value is not None and math.isfinite(value)}


def step_line(record: Mapping, level: int, total: int) -> str:
    """One step as a line: `level 1  step  12/100  newton 4  contacts 37  gap 1.2e-04  0.31 s`."""
    parts = [f"level {level}", f"step {record['step']:>{len(str(total))}}/{total}"]
    parts += [f"{label} {text}" for label, text in _shown(record).items()]
    seconds = record.get("seconds")
    total_seconds = seconds.get("total") if isinstance(seconds, Mapping) else seconds
    if total_seconds is not None:
        parts.append(f"{total_seconds:.2f} s")
    return "  ".join(parts)
