"""Where FFCx keeps the forms that it has compiled, used by one process at a time.

By itself FFCx lets a process wait for ten seconds while another one compiles the same form, and then fails: on a busy
machine, or after a process was killed while it compiled. Here processes wait for a lock, however long it takes, and the
next one removes what a killed one has left unfinished.
"""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from mpi4py import MPI

from pdvol.potentials.assembly import native

COMPILING, FINISHED = b"compiling", b"finished "
"""What the lock file holds, in equally many bytes: from the start of compiling on, and when it is done."""


@contextmanager
def form_cache(comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    """The options that make FFCx use the folder, for compiling within the `with` block. Collective."""
    folder = native.cache_folder() / "forms"
    options = {"cache_dir": str(folder)}
    lock = _locked(folder) if comm.rank == 0 else None
    if lock is None:
        yield options
        return
    with lock:  # closing the file releases the lock
        if lock.read() != FINISHED:
            for source in folder.glob("*.c"):
                if not source.with_name(source.name + ".cached").exists():
                    source.unlink(missing_ok=True)
        os.pwrite(lock.fileno(), COMPILING, 0)
        yield options
        os.pwrite(lock.fileno(), FINISHED, 0)


def _locked(folder: Path) -> IO[bytes] | None:
    """The folder's lock file, locked; None where files cannot be written or locked."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(folder / "lock", os.O_RDWR | os.O_CREAT, 0o666)
        lock = os.fdopen(descriptor, "rb+")
        fcntl.flock(lock, fcntl.LOCK_EX)
        return lock
    except OSError:
        return None
