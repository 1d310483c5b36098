"""A function in a child process, with limits of processor time and memory.

Libraries that read or make meshes may crash, hang, print or take all memory; only the child then ends. It is started
anew and not forked: it has no threads, locks and signal handlers of this process.
"""

import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.meshing.cpu_budget import ProcessFailed, ProcessStopped, Watch
from pdvol.processes import die_with_parent, limit_processor_time, without_launcher

LOOK_PAUSE = 1.0  # seconds between two looks at a child that works
KEPT = 10.0  # seconds without a call after which a child takes none, and ends soon: it holds 100 MB of libraries
_START = "import sys; sys.path[:] = sys.argv[2:]; import pdvol.meshing.child_process as c; c.serve(int(sys.argv[1]))"


class Child:
    """A process that calls functions, one after the other. It ends with this process."""

    def __init__(self, preload: Path | None = None):
        """`preload` is a shared library that is loaded before all others."""
        env = without_launcher()
        if preload is not None:
            env["LD_PRELOAD"] = ":".join(filter(None, [str(preload), env.get("LD_PRELOAD")]))
        self._calls, theirs = Pipe()
        with theirs:
            self._kept_until = time.monotonic() + KEPT
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, str(theirs.fileno()), *sys.path],
                env=env,
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
            )

    def __enter__(self) -> "Child":
        return self

    def __exit__(self, *error: object) -> None:
        self.end()

    @property
    def alive(self) -> bool:
        """Whether it can take a call."""
        return self._process.poll() is None and time.monotonic() < self._kept_until

    def call(
        self, who: str, function: Callable, *given: Any, cpu_seconds: float, memory: int | None = None, loads: str = ""
    ) -> Any:
        """The result of `function(*given)`. After an error other than an `InputError` of the function it has ended.

        Parameters
        ----------
        who : the one who works, as messages name it
        function : of the top level of a module that the child can import
        given : arguments that can be pickled
        cpu_seconds : processor time [s] that it may use. How busy the machine is does not matter to it.
        memory : bytes that it may take beyond what the process has before; no limit where None
        loads : a module that is imported before the limits hold

        Raises
        ------
        InputError
            As the function raised it.
        ProcessFailed
            The process crashed, or the function failed otherwise.
        ProcessStopped
            It waited without end, or used up its memory, its processor time, or that of the command (`BudgetSpent`).
        """
        try:
            with Watch(self._process.pid) as watch:
                self._calls.send((os.getcwd(), function, given, cpu_seconds, memory, loads))
                while not self._calls.poll(LOOK_PAUSE):
                    watch.check(who)
                done, answer = self._calls.recv()
        except (EOFError, ConnectionError):
            raise self._end_of(who, cpu_seconds) from None
        except BaseException:
            self.end()
            raise
        self._kept_until = time.monotonic() + KEPT
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
        self._process.kill()
        self._process.wait()
        self._calls.close()

    def _end_of(self, who: str, cpu_seconds: float) -> ProcessFailed:
        """Why the process has ended by itself."""
        code = self._process.wait()
        self._calls.close()
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


def serve(file: int) -> None:
    """In the child: answer the calls that come from a connection, by its file descriptor, until it closes or idles."""
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    calls, most = Connection(file), resource.getrlimit(resource.RLIMIT_AS)[1]
    while calls.poll(2.0 * KEPT):
        try:
            folder, function, given, cpu_seconds, memory, loads = calls.recv()
        except EOFError:
            return
        os.chdir(folder)
        if loads:
            import_module(loads)
        limit_processor_time(cpu_seconds)
        if memory is not None:
            resource.setrlimit(resource.RLIMIT_AS, (_address_space() + memory, most))
        try:
            answer = True, function(*given)
        except (InputError, MemoryError) as error:
            answer = False, error
        except BaseException as error:
            answer = False, " ".join(str(error).split())[:300] or type(error).__name__
        calls.send(answer)


def _address_space() -> int:
    """[bytes]"""
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGESIZE")
