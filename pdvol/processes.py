"""Processes that pdvol starts: they are not its MPI ranks, and they end with it."""

import contextlib
import ctypes
import math
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

from pdvol.errors import InputError

PATIENCE = 10.0  # seconds that a process has to end by itself
MOST_MEMORY = 2_000_000  # kilobytes of peak memory after which a process ends: another one then starts small
IDLE_LOOK = 0.2  # seconds in which idle cores are counted: 20 ticks of Linux's clock
_PR_SET_PDEATHSIG = 1  # of Linux's prctl
# Variables by which MPI launchers mark their ranks: a child must not inherit them.
_LAUNCHER_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "MPI_", "HYDRA_")
_START = "import sys; sys.path[:] = sys.argv[5:]; import pdvol.processes as p; p._serve(*sys.argv[1:5])"


class Beside(str):
    """A folder in `sys.path` in which processes find no modules: those beside a scene must be allowed to run."""


class ProcessEnded(RuntimeError):
    """A process has ended, as it does when it has become large."""


class Process:
    """A process that calls functions, one after the other. It ends with this process.

    It is started anew and not forked: it has no threads, locks and signal handlers of this process. It starts at once,
    prints nothing, and finds modules where this process does, but for those beside a scene. Ctrl-C is for this process
    alone.

    Parameters
    ----------
    modules : that it loads while the caller goes on
    kept : seconds without a call after which it takes none, and ends soon
    preload : a shared library that is loaded before all others

    Attributes
    ----------
    busy : whether a call is carried out
    """

    def __init__(self, modules: Sequence[str] = (), kept: float = math.inf, preload: Path | None = None):
        env = without_launcher()
        if preload is not None:
            env["LD_PRELOAD"] = ":".join(filter(None, [str(preload), env.get("LD_PRELOAD")]))
        self.busy, self._paused, self._kept, self._kept_until = False, False, kept, time.monotonic() + kept
        self._calls, theirs = Pipe()
        with theirs:
            words = [str(theirs.fileno()), str(os.getpid()), str(2.0 * kept), ",".join(modules)]
            words += [path for path in sys.path if not isinstance(path, Beside)]
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-c", _START, *words],
                env=env,
                pass_fds=(theirs.fileno(),),
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

    @property
    def process(self) -> int:
        """The process's id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it can take a call."""
        return self._process.poll() is None and time.monotonic() < self._kept_until

    @property
    def paused(self) -> bool:
        """Whether `pause` holds it."""
        return self._paused and self.alive

    def begin(
        self, function: Callable, *given: Any, cpu_seconds: float = math.inf, memory: int | None = None, loads: str = ""
    ) -> None:
        """Have it call `function(*given)`.

        Parameters
        ----------
        function : of the top level of a module that the process can import
        given : arguments that can be pickled
        cpu_seconds : processor time [s] that it may use. How busy the machine is does not matter to it.
        memory : bytes that it may take beyond what the process has before; no limit where None
        loads : a module that is imported before the limits hold

        Raises
        ------
        RuntimeError
            It is busy.
        ProcessEnded
            It has ended, perhaps just now.
        """
        if self.busy:
            raise RuntimeError("a process carries out one call at a time")
        call = os.getcwd(), function, given, cpu_seconds, memory, loads
        try:
            if not self.alive:
                raise BrokenPipeError
            self._calls.send(call)
        except OSError:
            raise ProcessEnded("the process has ended") from None
        self.busy = True

    def answer(self, seconds: float = 0.0) -> tuple[bool, Any] | None:
        """Whether the function has returned, and its result; or its InputError or MemoryError, or the text of another
        error. None where it works on after so many seconds.

        Raises
        ------
        ProcessEnded
            The process has ended before.
        """
        try:
            if not self._calls.poll(seconds):
                return None
            self.busy, found = False, self._calls.recv()
        except (EOFError, ConnectionError):
            raise ProcessEnded("the process has ended") from None
        self._kept_until = time.monotonic() + self._kept
        return found

    def interrupt(self) -> None:
        """Interrupt the call as Ctrl-C does, where its function allows that."""
        self.resume()
        if self.busy:
            self._signal(signal.SIGINT)

    def pause(self) -> None:
        """Hold the process until `resume`."""
        self._signal(signal.SIGSTOP)
        self._paused = True

    def resume(self) -> None:
        """Go on after `pause`."""
        self._signal(signal.SIGCONT)
        self._paused = False

    def stop(self, patience: float = PATIENCE) -> int:
        """End the process, without a call within so many seconds by itself; its exit status, or minus the signal that
        has ended it.
        """
        self.resume()
        self._calls.close()
        if patience and not self.busy:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(patience)
        self._process.kill()
        self.busy = False
        return self._process.wait()

    def _signal(self, number: int) -> None:
        self._process.send_signal(number)  # not os.kill: another process may have the number of one that has ended


def _serve(file: str, parent: str, kept: str, modules: str) -> None:
    """In the process: answer the calls that come from a connection, by its file descriptor, until it closes, or has
    none for so many seconds, or the process has become large.
    """
    die_with_parent()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    calls, most = Connection(int(file)), resource.getrlimit(resource.RLIMIT_AS)[1]
    largest = max(MOST_MEMORY, _peak_memory())  # Linux counts that of the process which has started this one
    for module in filter(None, modules.split(",")):
        import_module(module)
    seconds = None if kept == "inf" else float(kept)
    while os.getppid() == int(parent) and _peak_memory() <= largest and calls.poll(seconds):
        try:
            folder, function, given, cpu_seconds, memory, loads = calls.recv()
        except EOFError:
            return
        os.chdir(folder)
        if loads:
            import_module(loads)
        if cpu_seconds < math.inf:
            limit_processor_time(cpu_seconds)
        if memory is not None:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            resource.setrlimit(resource.RLIMIT_AS, (pages * os.sysconf("SC_PAGESIZE") + memory, most))
        try:
            answer = True, function(*given)
        except (InputError, MemoryError) as error:
            answer = False, error
        except BaseException as error:
            answer = False, " ".join(str(error).split())[:300] or type(error).__name__
        calls.send(answer)


def _peak_memory() -> int:
    """[kilobytes]"""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def die_with_parent() -> None:
    """In the child: makes Linux end it when its parent is killed."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def limit_processor_time(seconds: float) -> None:
    """In the child: SIGXCPU after so many more seconds [s] of processor time, but not beyond the parent's hard limit,
    which a user may not raise.
    """
    soft, hard = math.ceil(time.process_time() + seconds), resource.getrlimit(resource.RLIMIT_CPU)[1]
    resource.setrlimit(resource.RLIMIT_CPU, (soft if hard == resource.RLIM_INFINITY else min(soft, hard), hard))


def give_memory_back() -> None:
    """Lets the system have what this process has freed, where the C library is glibc: of a level's preparation it keeps
    3 KB a vertex otherwise.
    """
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


def without_launcher() -> dict[str, str]:
    """The environment of a child that is no MPI rank, with one thread. It finds modules in the working folder, which
    may have files from elsewhere, only where this process does.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith(_LAUNCHER_PREFIXES)}
    env["OMP_NUM_THREADS"] = "1"
    if sys.path[0] not in ("", os.getcwd()):
        env["PYTHONSAFEPATH"] = "1"
    return env


def processor_use(process: int) -> tuple[float, bool]:
    """Processor time [s] of a process and all that it has started, and whether all of them sleep.

    Zero where there is no such process, or no /proc.
    """
    try:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        tasks = list(Path(f"/proc/{process}/task").iterdir())
    except OSError:  # it has just ended, or this is no Linux
        return 0.0, False
    used, sleeps = sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK"), fields[0] == "S"  # with children that ended
    for task in tasks:
        children = ""
        with contextlib.suppress(OSError):  # a thread that has just ended
            children = (task / "children").read_text()
        for child in children.split():
            more, sleeps_too = processor_use(int(child))
            used, sleeps = used + more, sleeps and sleeps_too
    return used, sleeps


def cores() -> int:
    """Cores that this process may use: those it is bound to, and no more than its control group's quota."""
    count = len(os.sched_getaffinity(0))
    try:
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text().split()
        return count if quota == "max" else max(1, min(count, int(quota) // int(period)))
    except (OSError, ValueError):
        return count


def idle_cores() -> int:
    """Of `cores`, those that other processes leave idle now."""
    before = _idle_seconds()
    time.sleep(IDLE_LOOK)
    idle = (_idle_seconds() - before) / IDLE_LOOK
    busy = (os.cpu_count() or 1) - idle
    return max(1, round(cores() - busy))


def _idle_seconds() -> float:
    """Idle time [s] of all cores since the machine's start; that of the wall clock where Linux does not count it."""
    try:
        fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()
        return (int(fields[4]) + int(fields[5])) / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, IndexError):
        return time.monotonic() * (os.cpu_count() or 1)
