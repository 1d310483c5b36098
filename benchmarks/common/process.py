"""Processes of a study: a child with one thread and a limit of time, and the machine.

Nothing here loads numpy or pdvol: a child's peak memory (ru_maxrss) begins with its parent's.
"""

import os
import re
import signal
import subprocess
import time
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]
ENDING = 20.0
"""Seconds that a process is given to end after the request."""


class Mistake(Exception):
    """A mistake of the user's, with what to correct in one line."""


class Failure(Mistake):
    """A run without which a study cannot go on did not come to its end."""


def machine() -> dict:
    """Processor, cores, memory [GB] and load."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    found = {"processor": next(named, "unknown processor"), "cores": len(os.sched_getaffinity(0))}
    return {**found, "memory_gb": total, "load": os.getloadavg()[0]}


def peak_memory() -> float:
    """Largest resident size of this process [MB]. Linux' ru_maxrss would include the size of the process that started
    it.
    """
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return 0.0


# ---- a child


def child(command: list[str], limit: float, log: Path) -> str:
    """Runs a command with one thread, and this repository on its path. Returns an empty text when it succeeds, else the
    last line it printed.
    """
    path = os.pathsep.join(filter(None, [str(REPOSITORY), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": path}
    with log.open("w") as errors, log.with_suffix(".out").open("w") as out:
        begin = time.monotonic()
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=out, stderr=errors, env=environment, start_new_session=True
        )
        try:
            code = process.wait(limit)
        except subprocess.TimeoutExpired:
            return f"ended after {time.monotonic() - begin:.0f} s"
        finally:
            end(process)
    return "" if code == 0 else last_words(log) or f"exit code {code}"


def end(process: subprocess.Popen) -> None:
    """Ends a process of ours that still runs, by its own group. mpirun must end its ranks, since they are in groups of
    their own.
    """
    for sign in (signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            return
        os.killpg(process.pid, sign)
        try:
            process.wait(ENDING)
        except subprocess.TimeoutExpired:
            continue


def last_words(log: Path) -> str:
    """The last line of a log that names an error, since Open MPI prints much after it; or else the last line."""
    lines = [line.strip() for line in log.read_text(errors="replace").splitlines() if line.strip()]
    errors = [line for line in lines if re.match(r"[\w.]+(Error|Exception|Interrupt)\b", line)]
    return (errors or lines or [""])[-1][:300]
