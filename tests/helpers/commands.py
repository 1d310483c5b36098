"""pdvol's command in a process of its own."""

import sys
from contextlib import suppress
from pathlib import Path

PDVOL = [sys.executable, "-c", "import pdvol; pdvol.main()"]
WITHOUT_PICTURE = [sys.executable, str(Path(__file__).with_name("without_picture.py"))]
"""As `PDVOL`, but without the picture that ends a run: it takes longer than the runs of most tests."""
SAFETY = 1800.0
"""Seconds after which a process is taken to hang. No test depends on it: a busy machine needs a small part of it."""


def children(process: int) -> list[int]:
    """Those that a process has started, by their ids."""
    found = []
    for task in Path(f"/proc/{process}/task").iterdir():
        with suppress(FileNotFoundError):  # a thread that has just ended
            found += map(int, (task / "children").read_text().split())
    return found
