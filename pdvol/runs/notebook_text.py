"""The progress of a call as one output of a notebook's cell, which replaces itself: a saved notebook keeps its last
state, not every line that it has shown.
"""

import sys
from typing import TextIO


def progress_stream() -> TextIO:
    """Where progress goes: an output of the notebook's cell, or standard error."""
    return NotebookText() if in_notebook() else sys.stderr  # type: ignore[return-value]  # what progress needs of one


def in_notebook() -> bool:
    """Whether an IPython kernel runs this: a notebook, or a console that shows the same."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


class NotebookText:
    """What a terminal would show of the text that is written to it, as a cell's output.

    A carriage return goes to the beginning of the last line, and what follows replaces that line.
    """

    encoding = "utf-8"  # bars have finer blocks where a stream names it

    def __init__(self) -> None:
        from IPython.display import display

        self._lines, self._shown = [""], ""
        self._handle = display({"text/plain": ""}, raw=True, display_id=True)

    def isatty(self) -> bool:
        """A line can be rewritten here."""
        return True

    def write(self, text: str) -> int:
        """Add text, which `flush` shows."""
        for number, line in enumerate(text.replace("\x1b[K", "").replace("\x1b[A", "").split("\n")):
            if number:
                self._lines.append("")
            self._lines[-1] = (self._lines[-1] + line).split("\r")[-1]
        return len(text)

    def flush(self) -> None:
        """Show what was written."""
        shown = "\n".join(line.rstrip() for line in self._lines).rstrip()
        if shown != self._shown:
            self._shown = shown
            self._handle.update({"text/plain": shown}, raw=True)
