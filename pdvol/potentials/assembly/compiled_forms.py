"""Where FFCx keeps the forms that it has compiled, used by one process at a time.

By itself FFCx lets a process wait for ten seconds while another one compiles the same form, and then fails: on a busy
machine, or after a process was killed while it compiled. Here processes wait for a lock, however long it takes, and the
next one removes what a killed one has left unfinished.
"""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from mpi4py import MPI

from pdvol.potentials.assembly import native


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
        if lock.read() != "finished":
            for source in folder.glob("*.c"):
                if not source.with_name(source.name + ".cached").exists():
                    source.unlink(missing_ok=True)
        _write(lock, "compiling")
        yield options
        _write(lock, "finished")


def _locked(folder: Path) -> IO[str] | None:
    """The folder's lock file, locked; None where files cannot be written or locked."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = open(folder / "lock", "a+")
        fcntl.flock(lock, fcntl.LOCK_EX)
        lock.seek(0)
        return lock
    except OSError:
        return None


def _write(lock: IO[str], state: str) -> None:
    lock.truncate(0)
    lock.write(state)
    lock.flush()
