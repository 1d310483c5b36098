"""Reads a file in a forked child process with limits on its processor time and memory.

Libraries that read meshes may crash, hang or take all memory on a damaged file; only the child process then ends.
"""

import contextlib
import os
import resource
import select
import signal
import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.meshing.cpu_budget import BudgetSpent, Watch
from pdvol.processes import die_with_parent, limit_processor_time

BASE_SECONDS = 6.0  # limit on processor time [s] for a file of no size: leaves time to load a library
BYTES_PER_SECOND = 1e6  # file size [bytes] that adds one second to that limit: large files take longer to parse
BASE_MEMORY = 600 * 2**20  # memory limit [bytes] for a file of no size, beyond what the process already uses
MEMORY_PER_BYTE = 60  # memory [bytes] that each byte of the file adds to the limit: text is read into Python objects


def read_in_child_process(path: Path, read: Callable[[Path], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The result of `read(path)`, which runs in a child process.

    Raises
    ------
    MeshError
        `read` crashed, hung, or exceeded the limit on processor time or memory for a file of this size.
    InputError
        As `read` raised it.
    """
    size = path.stat().st_size
    seconds, memory = BASE_SECONDS + size / BYTES_PER_SECOND, int(BASE_MEMORY + MEMORY_PER_BYTE * size)
    with tempfile.TemporaryDirectory(prefix="pdvol-read-") as folder:
        answer = Path(folder) / "answer"
        watched, held = os.pipe()
        with warnings.catch_warnings():
            # Python warns of forking a process that has threads; the child needs none of their locks.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = os.fork()
        if child == 0:
            _read_and_exit(path, read, answer, seconds, memory)
        os.close(held)
        try:
            watch, reason = Watch(child), ""
            while not select.select([watched], [], [], 1.0)[0]:  # the child's end closes with it
                reason = watch.reason_to_end()
                if reason:
                    os.kill(child, signal.SIGKILL)
                    break
        finally:
            os.close(watched)
            _, status = os.waitpid(child, 0)
        code = os.waitstatus_to_exitcode(status)
        if code == -signal.SIGXCPU:
            raise MeshError(f"{path}: not read within {seconds:.0f} s of processor time; export the mesh again")
        if watch.spent:
            raise BudgetSpent(f"{path}: {reason}")
        if reason:
            raise MeshError(f"{path}: unreadable, its reader {reason}; export the mesh again")
        if code == 0:
            with np.load(answer, allow_pickle=False) as data:
                return dict(data)
        written = answer.read_text(encoding="utf-8", errors="replace") if answer.exists() else ""
        kind, _, message = written.partition(":")
        if kind == "InputError":
            raise InputError(message)
        raise MeshError(message or f"{path}: unreadable, its reader crashed; export the mesh again")


def _read_and_exit(path: Path, read: Callable, answer: Path, seconds: float, memory: int) -> None:
    """Runs in the child process: writes the arrays or the error message to `answer` and exits."""
    code = 1
    try:
        die_with_parent()
        for number in (
            signal.SIGSEGV,
            signal.SIGBUS,
            signal.SIGFPE,
            signal.SIGABRT,
            signal.SIGTERM,
            signal.SIGINT,
            signal.SIGXCPU,
        ):
            signal.signal(number, signal.SIG_DFL)  # PETSc's handlers would abort all ranks
        used = (
            int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            if os.path.exists("/proc/self/statm")
            else 2**32
        )
        resource.setrlimit(resource.RLIMIT_AS, (used + memory, used + memory))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        limit_processor_time(seconds)
        try:
            arrays = read(path)
            with open(answer, "wb") as file:
                np.savez(file, **arrays)
            code = 0
        except InputError as error:
            answer.write_text(
                f"{'MeshError' if isinstance(error, MeshError) else 'InputError'}:{error}",
                encoding="utf-8",
                errors="replace",
            )
        except MemoryError:
            answer.write_text(
                f"MeshError:{path}: wants more memory than a file of its size does; export the mesh again",
                errors="replace",
            )
    except BaseException:  # nothing of the parent's code may run on in the child
        with contextlib.suppress(BaseException):
            answer.unlink(missing_ok=True)
    finally:
        os._exit(code)
