"""Processes that kill themselves at a file operation of a given number: at the same instant on every machine."""

import os
import signal
import sys
from pathlib import Path

HELPERS = str(Path(__file__).parent)
OPERATIONS = {"open", "os.mkdir", "os.remove", "os.rename", "os.truncate"}


class FileOperations:
    """Counts the operations of this process on files of a folder, and kills it (SIGKILL) before the one of number
    `deadly`; 0 lets it live.
    """

    def __init__(self, folder: str, deadly: int):
        self.folder, self.deadly, self.count = os.path.abspath(folder), deadly, 0
        sys.addaudithook(self._notice)

    def _notice(self, event: str, arguments: tuple) -> None:
        if event not in OPERATIONS or not isinstance(arguments[0], str | bytes | os.PathLike):
            return
        if os.path.abspath(os.fsdecode(arguments[0])).startswith(self.folder):
            self.count += 1
            if self.count == self.deadly:
                os.kill(os.getpid(), signal.SIGKILL)


class PressesCtrlC:
    """What follows the steps of a run, until it interrupts the one of number `steps`."""

    def __init__(self, steps: int):
        self.left = steps

    def __call__(self, level: int, steps: int, done: int) -> "PressesCtrlC":
        return self

    def step(self, record: dict) -> None:
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt

    def lasts(self, record: dict) -> None:
        pass

    def close(self) -> None:
        pass
