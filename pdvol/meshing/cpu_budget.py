"""Processor time that all work on a command's meshes shares: reading, checks, decimation, and processes of meshers.

Work in this process asks `check_budget` between its steps; a `Watch` looks at a child that it waits for once a second.
Running out of time is always an error. No result depends on how much is left.
"""

import time
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


class ProcessFailed(MeshError):
    """A process crashed, or failed for a reason of the library that works in it."""


class ProcessStopped(ProcessFailed):
    """A process ran out of processor time or memory, or waited without end: it is not tried again."""


class BudgetSpent(ProcessStopped):
    """The command's processor time is used up."""


_ends: list[tuple[float, float]] = []
"""Of the budget in force: `_used()` [s] at which it ends, and its length [s]."""
_watches: set["Watch"] = set()
_ended_children = 0.0  # processor time [s] of calls in children that are over


@contextmanager
def cpu_budget(vertices: int = 0, seconds: float | None = None) -> Iterator[None]:
    """Within the block, this process and the calls in its children may use `seconds` [s] together, by default those for
    meshes of `vertices`.

    A block inside another one belongs to the outer one's budget.
    """
    if _ends:
        yield
        return
    length = INPUT_SECONDS + SECONDS_PER_VERTEX * vertices if seconds is None else seconds
    _ends.append((_used() + length, length))
    try:
        yield
    finally:
        _ends.clear()


def spend() -> None:
    """Use up the budget in force: what works on meshes in other threads and processes ends within a second."""
    if _ends:
        _ends[0] = 0.0, _ends[0][1]


def check_budget(name: str) -> None:
    """Raise BudgetSpent where the budget in force is used up; `name` begins the message."""
    if _ends and _used() > _ends[0][0]:
        raise BudgetSpent(
            f"{name}: not done within the {_ends[0][1]:g} s of processor time that the meshes may use; give a"
            " smaller or cleaner one"
        )


def _used() -> float:
    """Processor time [s] of this process and of the calls in its children."""
    return time.process_time() + _ended_children + sum(watch.used for watch in tuple(_watches))


class Watch:
    """Looks at a child process during one call.

    Attributes
    ----------
    used : processor time [s] of the call, at the last look
    """

    def __init__(self, process: int):
        self.process, self.idle, self.used = process, 0, 0.0
        self._before = processor_use(process)[0]

    def __enter__(self) -> "Watch":
        _watches.add(self)
        return self

    def __exit__(self, *error: object) -> None:
        global _ended_children
        self._look()
        _watches.discard(self)
        _ended_children += self.used

    def check(self, who: str) -> None:
        """Raise ProcessStopped where the process must end now; `who` begins the message. To be called once a second."""
        before = self.used
        sleeps = self._look()
        check_budget(who)
        self.idle = self.idle + 1 if sleeps and self.used == before else 0
        if self.idle > IDLE_LOOKS:
            raise ProcessStopped(f"{who} waits for something that never comes")

    def _look(self) -> bool:
        """Whether the process sleeps."""
        used, sleeps = processor_use(self.process)
        self.used = max(self.used, used - self._before)  # no less where it has ended
        return sleeps
