"""Processor time that all work on a command's meshes shares: reading, checks, decimation, and processes of meshers.

Work in this process asks `check_budget` between its steps; a process that it waits for is looked at once a second by a
`Watch`. Running out of time is always an error. No result depends on how much is left.
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from pdvol.errors import MeshError
from pdvol.processes import processor_use

INPUT_SECONDS = 100.0
"""Processor time [s] that the work on one command's meshes may use, besides `SECONDS_PER_VERTEX`. The work between two
checks of it takes less than 20 s for files up to 50 MB, which ends a command within 120 s.
"""
SECONDS_PER_VERTEX = 0.02
"""Processor time [s] that each wanted vertex adds: two to ten times what it takes."""
IDLE_LOOKS = 120
"""Looks, one a second, after which a process that sleeps and uses no processor is ended."""


class ProcessStopped(MeshError):
    """A process ran out of processor time, or waited without end: it is not tried again."""


class BudgetSpent(ProcessStopped):
    """The command's processor time is used up."""


_ends: list[tuple[float, float]] = []
"""Of the budget in force: processor time [s] of this process and its children at which it ends, and its length [s]."""


@contextmanager
def cpu_budget(vertices: int = 0, seconds: float | None = None) -> Iterator[None]:
    """Within the block, all processes together may use `seconds` [s], by default those for meshes of `vertices`.

    A block inside another one belongs to the outer one's budget.
    """
    if _ends:
        yield
        return
    length = INPUT_SECONDS + SECONDS_PER_VERTEX * vertices if seconds is None else seconds
    _ends.append((processor_use(os.getpid())[0] + length, length))
    try:
        yield
    finally:
        _ends.clear()


def check_budget(name: str) -> None:
    """Raise BudgetSpent where the budget in force is used up; `name` begins the message."""
    if _spent():
        raise BudgetSpent(f"{name}: {_words()}")


def _spent() -> bool:
    return bool(_ends) and processor_use(os.getpid())[0] > _ends[0][0]


def _words() -> str:
    length = _ends[0][1] if _ends else 0.0
    return f"not done within the {length:g} s of processor time that the meshes may use; give a smaller or cleaner one"


class Watch:
    """Looks at a child process: whether it may go on."""

    def __init__(self, process: int):
        self.process, self.idle, self.before = process, 0, -1.0
        self.spent = False

    def reason_to_end(self) -> str:
        """Why the process must end now, in words; empty while it may go on. To be called once a second."""
        if _spent():
            self.spent = True
            return _words()
        used, sleeps = processor_use(self.process)
        self.idle = self.idle + 1 if sleeps and used == self.before else 0
        self.before = used
        return "waits for something that never comes" if self.idle > IDLE_LOOKS else ""
