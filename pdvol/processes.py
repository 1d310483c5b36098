"""Processes that pdvol starts: they are not its MPI ranks, and they end with it."""

import contextlib
import ctypes
import math
import os
import resource
import signal
import sys
import time
from pathlib import Path

IDLE_LOOK = 0.2  # seconds in which idle cores are counted: 20 ticks of Linux's clock
_PR_SET_PDEATHSIG = 1  # of Linux's prctl
# Variables by which MPI launchers mark their ranks: a child must not inherit them.
_LAUNCHER_PREFIXES = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "MPI_", "HYDRA_")


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
