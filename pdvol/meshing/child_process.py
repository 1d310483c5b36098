"""A function in a child process, with limits of processor time and memory.

Libraries that read or make meshes may crash, hang, print or take all memory; only the child then ends.
"""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.meshing.cpu_budget import ProcessFailed, ProcessStopped, Watch
from pdvol.processes import Process, ProcessEnded

LOOK_PAUSE = 1.0  # seconds between two looks at a child that works
KEPT = 10.0  # seconds without a call after which a child takes none, and ends soon: it holds 100 MB of libraries


class Child(Process):
    """A process that calls functions, one after the other. It ends with this process."""

    def __init__(self, preload: Path | None = None):
        """`preload` is a shared library that is loaded before all others."""
        super().__init__(kept=KEPT, preload=preload)

    def __enter__(self) -> "Child":
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    def call(
        self, who: str, function: Callable, *given: Any, cpu_seconds: float, memory: int | None = None, loads: str = ""
    ) -> Any:
        """The result of `function(*given)`; arguments as `Process.begin` has them, and `who` works, as messages name
        it. After an error other than an `InputError` of the function it has ended.

        ProcessFailed is raised where the process crashed, or the function failed otherwise; ProcessStopped where it
        waited without end, or used up its memory, its processor time, or that of the command (`BudgetSpent`).
        """
        try:
            with Watch(self.process) as watch:
                self.begin(function, *given, cpu_seconds=cpu_seconds, memory=memory, loads=loads)
                while (found := self.answer(LOOK_PAUSE)) is None:
                    watch.check(who)
        except ProcessEnded:
            raise self._end_of(who, cpu_seconds) from None
        except BaseException:
            self.end()
            raise
        done, answer = found
        if done:
            return answer
        if isinstance(answer, InputError):
            raise answer
        self.end()
        if isinstance(answer, MemoryError):
            raise ProcessStopped(f"{who} wants more memory than the {(memory or 0) / 2**20:,.0f} MiB that it may take")
        raise ProcessFailed(f"{who} failed: {answer}")

    def end(self) -> None:
        """End the process, whatever it does."""
        self.stop(0.0)

    def _end_of(self, who: str, cpu_seconds: float) -> ProcessFailed:
        """Why the process has ended by itself."""
        code = self._process.wait()
        self.end()
        if code == -signal.SIGXCPU:
            return ProcessStopped(f"{who} used up its {cpu_seconds:.0f} s of processor time")
        if code == -signal.SIGKILL:
            return ProcessStopped(f"{who} was killed, probably for lack of memory")
        how = f"crashed ({signal.Signals(-code).name})" if code < 0 else f"failed: exit status {code}"
        return ProcessFailed(f"{who} {how}")


def in_child(who: str, function: Callable, *given: Any, cpu_seconds: float) -> Any:
    """`Child.call` in a process that ends with it."""
    with Child() as child:
        return child.call(who, function, *given, cpu_seconds=cpu_seconds)
