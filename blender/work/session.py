"""What the buttons have set off: one task at a time, and the caches of what it has stored so far.

Nothing here waits for a process: `tick` is called again and again, as by a timer, and says what has happened since.
"""

import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from ..shot.files import Places
from . import commands
from .play import make_caches
from .process import Process
from .progress import RunProgress

# an export's duration, times this, is the pause before the next one: exports take a fifth of the time at most
PAUSE = 4.0
LEAST_PAUSE = 1.5  # seconds between the same
SO_FAR = "so far"  # how a line of pdvol ends about a step that lasts


@dataclass(frozen=True)
class Task:
    """What a button sets off.

    Attributes
    ----------
    title : in the panel, as "Preview"
    steps : command lines of pdvol, one after the other; the first that fails ends the task
    run : the number of the run that they make; 0 where they make none
    before : the number of the run that was shown before; 0 where none was
    """

    title: str
    steps: Sequence[Sequence[str]]
    run: int = 0
    before: int = 0


@dataclass(frozen=True)
class Frames:
    """The caches of a level of a run have been made anew, with so many frames."""

    run: int
    level: int
    frames: int


@dataclass(frozen=True)
class Ended:
    """A task has ended; `error` is empty where all is well, and a line where it is not."""

    task: Task
    error: str
    lines: list[str]


Event = Frames | Ended


class Command(Protocol):
    """What a session needs of a process; `Process` is one."""

    @property
    def code(self) -> int | None:
        """The exit status; None while it runs."""

    def cancel(self) -> None:
        """End it."""

    def lines(self) -> list[str]:
        """What it has printed last."""

    def reason(self) -> str:
        """Why it ended early."""


@dataclass
class Session:
    """One task at a time. `message` says how it stands, `error` how the last one went wrong, `notes` what it has found;
    all may be empty.
    """

    message: str = ""
    error: str = ""
    notes: list[str] = field(default_factory=list)
    task: Task | None = None
    progress: RunProgress | None = None
    _process: Command | None = None
    _export: Command | None = None
    _left: list[Sequence[str]] = field(default_factory=list)
    _exported: dict[int, int] = field(default_factory=dict)
    _exporting: tuple[int, int] = (0, 0)
    _started: float = 0.0
    _began: float = 0.0
    _next_export: float = 0.0

    @property
    def busy(self) -> bool:
        """Whether a task is going on."""
        return self.task is not None

    def start(self, task: Task, places: Places, pdvol: Sequence[str], fps: float) -> None:
        """Begin a task; one that is going on is cancelled.

        Parameters
        ----------
        pdvol : the words that start pdvol; empty where the steps are whole command lines
        fps : frames a second of Blender's scene
        """
        self.cancel()
        self.task, self.error, self.message, self.notes = task, "", task.title, []
        self._places, self._pdvol, self._fps = places, list(pdvol), fps
        self._left, self._exported, self._next_export = list(task.steps), {}, 0.0
        self.progress = RunProgress(places.run(task.run)) if task.run else None
        places.log.unlink(missing_ok=True)
        self._started = time.monotonic()
        self._go_on()

    def cancel(self) -> None:
        """End what is going on; what is stored is kept."""
        for process in (self._process, self._export):
            if process is not None:
                process.cancel()
        if self.task is not None:
            self.message = f"{self.task.title}: cancelled"
        self.task = self._process = self._export = None

    def tick(self) -> list[Event]:
        """What has happened since the last call."""
        if self.task is None:
            return []
        events: list[Event] = []
        if self.progress is not None:
            self.progress.look()
        if self._export is not None and self._export.code is not None:
            events += self._end_export(self._export)
        if self._process is not None and self._process.code is not None:
            if self._process.code == 0 and self._left:
                self._go_on()
            else:
                self._lines = self._process.lines()
                self.error = "" if self._process.code == 0 else self._process.reason()
                self._process, self._next_export = None, 0.0
        if self._process is None or time.monotonic() >= self._next_export:
            self._begin_export()
        self._say()
        if self._process is None and self._export is None:
            task, self.task = self.task, None
            self.message = f"{task.title}: {self.error or 'done'}"
            events.append(Ended(task, self.error, self._lines))
        return events

    def fraction(self) -> float:
        """Of the level that is being computed, 0 to 1; of other tasks 0."""
        reached = self.progress.reached if self.progress is not None else {}
        return self.progress.fraction(max(reached)) if self.progress is not None and reached else 0.0

    def _go_on(self) -> None:
        self._process = Process([*self._pdvol, *self._left.pop(0)], self._places.log)

    def _say(self) -> None:
        assert self.task is not None
        line = self.progress.line() if self.progress is not None else ""
        said = self._process.lines()[-1:] if self._process is not None else []
        lasts = [text for text in said if text.endswith(SO_FAR)]
        title = self.task.title if self.task.run else f"{self.task.title}, {time.monotonic() - self._started:.0f} s"
        self.message = ": ".join([title, *(lasts or [line] if line else said)])

    def _begin_export(self) -> None:
        """Export a level that has new states, the finest first; none where one is under way."""
        if self._export is not None or self.task is None or self.progress is None:
            return
        run, reached = self.progress.folder, self.progress.reached
        new = [level for level, step in reached.items() if step > self._exported.get(level, 0)]
        if not new:
            return
        level = max(new)
        self._exporting, self._began = (level, reached[level]), time.monotonic()
        words = [*self._pdvol, *commands.export(run, level, self._fps, self._export_folder())]
        self._export = Process(words, self._places.log.with_name("export_log.txt"))

    def _end_export(self, export: Command) -> list[Event]:
        level, step = self._exporting
        self._exported[level], self._export = step, None
        now = time.monotonic()
        self._next_export = now + max(LEAST_PAUSE, PAUSE * (now - self._began))
        assert self.task is not None
        if export.code != 0:
            self.error = self.error or f"level {level} cannot be shown: {export.reason()}"
            return []
        try:
            frames = make_caches(self._places, self._export_folder(), self.task.run, level)
        except (OSError, ValueError) as error:
            self.error = self.error or f"level {level} cannot be shown: {error}"
            return []
        return [Frames(self.task.run, level, frames)]

    def _export_folder(self) -> Path:
        return self._places.folder / "export"


def forget_run(places: Places, number: int) -> None:
    """Remove a run and its caches."""
    shutil.rmtree(places.run(number), ignore_errors=True)
    shutil.rmtree(places.play(number), ignore_errors=True)
