"""A command as a process of its own, which never outlives Blender (`watch.py`)."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from ..shot.names import CLOSE_HOLES, WIDEST_HOLE

WATCH = Path(__file__).with_name("watch.py")
ENDS_WITHIN = 10.0  # seconds in which a cancelled command has to be gone: those of `watch.py`, and a slow machine's
TAIL = 8000  # bytes at the end of a log that are looked at for its last line
REMEDIES = ("close the holes, as pdvol repair does", "repair the self-intersections, as pdvol repair does")
"""What pdvol advises against defects of a mesh, which here is a setting."""
NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)  # of Windows


class Process:
    """A command that runs. What it prints is appended to the file `log`."""

    def __init__(self, words: Sequence[str], log: Path):
        log.parent.mkdir(parents=True, exist_ok=True)
        self._log, self._begin = log, log.stat().st_size if log.exists() else 0
        self._watch = subprocess.Popen(
            [sys.executable, str(WATCH), str(log), *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            creationflags=NO_WINDOW,
        )

    @property
    def code(self) -> int | None:
        """The exit status; None while it runs."""
        return self._watch.poll()

    def wait(self, seconds: float | None = None) -> int:
        """The exit status, once it has ended; subprocess.TimeoutExpired where that takes longer."""
        return self._watch.wait(seconds)

    def cancel(self) -> None:
        """End it, with all that it has started; returns when that is done."""
        if self._watch.stdin is not None:
            self._watch.stdin.close()
        try:
            self._watch.wait(ENDS_WITHIN)
        except subprocess.TimeoutExpired:
            self._watch.kill()
            self._watch.wait()

    def lines(self) -> list[str]:
        """The last lines that it has printed, without empty ones."""
        try:
            with open(self._log, "rb") as file:
                file.seek(max(self._begin, self._log.stat().st_size - TAIL))
                text = file.read().decode("utf-8", "replace")
        except OSError:
            return []
        return [line.strip() for line in text.splitlines() if line.strip()]

    def reason(self) -> str:
        """Why it ended early, in one line: pdvol's own, or its last one."""
        lines = self.lines()
        own = [line.removeprefix("pdvol: ") for line in lines if line.startswith("pdvol: ")]
        return with_settings((own or lines or [f"it ended with status {self.code}"])[-1])


def with_settings(line: str) -> str:
    """A message of pdvol that names the panel's setting where one repairs what is wrong."""
    for remedy in REMEDIES:
        line = line.replace(remedy, f"tick {CLOSE_HOLES} (sidebar, Object)")
    return line.replace("--hole", WIDEST_HOLE)
