"""Work on files that nobody vouches for, in a forked child with a limit on its time and memory: its crash, hang or
greed stays its own.
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
from pdvol.processes import die_with_parent

SECONDS, PER_SECOND = 6.0, 1e6  # allowed for any file, and bytes of it that buy another second
ROOM, PER_BYTE = 600 * 2**20, 60  # bytes of memory for any file, and for each of its bytes


def read_bounded(path: Path, read: Callable[[Path], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """`read(path)`, done in a child.

    Raises
    ------
    MeshError
        It crashed, or wanted more time or memory than files of this size do.
    InputError
        As `read` raised.
    """
    size = path.stat().st_size
    seconds, room = SECONDS + size / PER_SECOND, int(ROOM + PER_BYTE * size)
    with tempfile.TemporaryDirectory(prefix="pdvol-read-") as folder:
        answer = Path(folder) / "answer"
        watched, held = os.pipe()
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", DeprecationWarning
            )  # of forks beside threads: the child needs none of their locks
            child = os.fork()
        if child == 0:
            _work(path, read, answer, room)
        os.close(held)
        try:
            ended = bool(select.select([watched], [], [], seconds)[0])  # the child's end closes with it
            if not ended:
                os.kill(child, signal.SIGKILL)
        finally:
            os.close(watched)
            _, status = os.waitpid(child, 0)
        if not ended:
            raise MeshError(f"{path}: not read within {seconds:.0f} s; export the mesh again")
        if os.waitstatus_to_exitcode(status) == 0:
            with np.load(answer, allow_pickle=False) as data:
                return dict(data)
        told = answer.read_text(encoding="utf-8", errors="replace") if answer.exists() else ""
        kind, _, message = told.partition(":")
        if kind == "InputError":
            raise InputError(message)
        raise MeshError(message or f"{path}: unreadable, its reader crashed; export the mesh again")


def _work(path: Path, read: Callable, answer: Path, room: int) -> None:
    """In the child, which never returns."""
    code = 1
    try:
        die_with_parent()
        for number in (signal.SIGSEGV, signal.SIGBUS, signal.SIGFPE, signal.SIGABRT, signal.SIGTERM, signal.SIGINT):
            signal.signal(number, signal.SIG_DFL)  # PETSc's handlers would end all ranks
        used = (
            int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            if os.path.exists("/proc/self/statm")
            else 2**32
        )
        resource.setrlimit(resource.RLIMIT_AS, (used + room, used + room))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
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
    except BaseException:  # noqa: BLE001: nothing of the parent's may run on in the child
        with contextlib.suppress(BaseException):
            answer.unlink(missing_ok=True)
    finally:
        os._exit(code)
