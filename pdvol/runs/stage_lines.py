"""Stages on standard error: on a terminal one line that is rewritten while they last, in a log plain lines.

A stage that took a second or longer leaves a line with its duration, whichever the stream; one that an error ended
does not, since the error has a line of its own. In a log a stage that lasts long has further lines meanwhile, the
first after 30 s, and each one after twice the time of the one before.
"""

import shutil
import sys
from collections.abc import Callable
from threading import Condition, Thread
from typing import TextIO

from pdvol.stages import Stage

SHOWN_SECONDS = 1.0  # duration from which on a stage leaves a line: shorter ones are not waited for
FIRST_SIGN = 0.5  # seconds after which a terminal shows a stage that lasts
LONG_SECONDS = 30.0  # time after which a log says that a stage still lasts
SO_FAR = "so far"  # how a log's line about what lasts ends
_REWRITTEN_EVERY = 0.5  # seconds
_ERASED_LINE = "\r\x1b[K"  # the cursor goes to the beginning of a terminal's line, which is cleared


class StageLines:
    """Shows stages on a stream, by one rank.

    Parameters
    ----------
    stream : text stream; standard error when None
    rank : this process's rank, evaluated when something is to be shown; ranks other than 0 are silent
    """

    def __init__(self, stream: TextIO | None = None, rank: Callable[[], int] = lambda: 0):
        self.stream = sys.stderr if stream is None else stream
        self._terminal = self.stream.isatty()
        self._rank, self._written = rank, False
        self._changed = Condition()
        self._active: list[Stage] = []
        self._next: dict[Stage, float] = {}
        self._watch: Thread | None = None

    def begin(self, stage: Stage) -> None:
        """Watches the stage from a thread of its own, which ends with the last stage."""
        with self._changed:
            self._active.append(stage)
            self._next[stage] = LONG_SECONDS
            if self._watch is None:
                self._watch = Thread(target=self._look, name="pdvol-stages", daemon=True)
                self._watch.start()

    def end(self, stage: Stage) -> None:
        """Leaves a line where the stage took long enough."""
        with self._changed:
            self._active.remove(stage)
            del self._next[stage]
            leaves_line = stage.seconds >= SHOWN_SECONDS and not stage.failed
            if self._written or leaves_line:
                self._wipe()
            if leaves_line:
                self._write(finished_line(stage) + "\n")
            self._changed.notify_all()

    def _look(self) -> None:
        with self._changed:
            while self._active:
                self._changed.wait(_REWRITTEN_EVERY)
                if self._terminal:
                    self._rewrite()
                    continue
                for stage in self._active:
                    if stage.elapsed() >= self._next[stage]:
                        self._write(f"{lasting(stage)} {SO_FAR}\n")
                        self._next[stage] *= 2.0
            self._watch = None

    def _rewrite(self) -> None:
        shown = [lasting(stage) for stage in self._active if stage.elapsed() >= FIRST_SIGN]
        if shown:
            self._wipe()
            self._write(" | ".join(shown)[: max(shutil.get_terminal_size().columns - 1, 1)])
            self._written = True

    def _wipe(self) -> None:
        """Clears a terminal's line, in which a level's bar may stand, too."""
        if self._terminal:
            self._write(_ERASED_LINE)
        self._written = False

    def _write(self, text: str) -> None:
        if self._rank() == 0:
            self.stream.write(text)
            self.stream.flush()


def lasting(stage: Stage) -> str:
    """A stage that lasts in a few words: `meshing body 'ball', level 2 (try 3), 12 s`."""
    detail = stage.within or stage.detail
    return f"{stage.name}{f' ({detail})' if detail else ''}, {duration(stage.elapsed(), 0)}"


def finished_line(stage: Stage) -> str:
    """A stage that has ended in a line, with its long parts: `preparing level 0: 9.1 s (compiling forms 8.2 s)`."""
    parts = [f"{name} {duration(seconds)}" for name, seconds in stage.parts.items() if seconds >= SHOWN_SECONDS]
    details = "; ".join(([stage.detail] if stage.detail else []) + parts)
    return f"{stage.name}: {duration(stage.seconds)}{f' ({details})' if details else ''}"


def duration(seconds: float, digits: int = 1) -> str:
    """`12.3 s` or `2 min 5 s`."""
    if seconds < 60.0:
        return f"{seconds:.{digits}f} s"
    return f"{int(seconds) // 60} min {int(seconds) % 60} s"


def real_time(shot: float, spent: float) -> str:
    """How fast steps are, from their seconds of the shot and of computing: `real-time factor 2.2`."""
    return f"real-time factor {shot / max(spent, 1e-9):.2g}"
