"""Where FFCx keeps the forms that it has compiled: each process compiles aside, and what is finished is renamed.

By itself FFCx lets a process wait for ten seconds while another one compiles the same form, and then fails: on a busy
machine, or for ever after a process was killed while it compiled. Here nobody waits. A process works in a folder of its
own that begins with links to all finished forms. What it adds there is renamed into the common folder, which therefore
never holds a half-made form. Two processes that compile one form at once make the same file, and either one stays.
"""

import contextlib
import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI

from pdvol.potentials.assembly import native

ASIDE = "aside-"
"""How the names of the processes' own folders begin."""
ABANDONED_SECONDS = 86_400.0
"""Age [s] of a folder from which on nobody works in it: that of a killed process. Compiling takes seconds."""
READY = ".c.cached"
"""The ending of the file by which FFCx marks a form as compiled."""


@contextmanager
def form_cache(comm: MPI.Comm) -> Iterator[dict[str, Any]]:
    """The options that make FFCx use the kept forms, for compiling within the `with` block. Collective."""
    folder = native.cache_folder() / "forms"
    own = comm.bcast(_own_folder(folder) if comm.rank == 0 else None)
    try:
        yield {"cache_dir": str(own)}
        comm.barrier()  # the other ranks load what the first one has compiled
        if comm.rank == 0:
            _publish(own, folder)
    finally:
        if comm.rank == 0:
            shutil.rmtree(own, ignore_errors=True)


def _own_folder(folder: Path) -> Path:
    """A new folder with links to all finished forms; among temporary files where `folder` cannot be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        own = Path(tempfile.mkdtemp(prefix=ASIDE, dir=folder))
    except OSError:
        own = Path(tempfile.mkdtemp(prefix="pdvol-forms-"))
    for kept in _finished(folder):
        with contextlib.suppress(OSError):  # a form without its link is compiled again
            (own / kept.name).symlink_to(kept)
    for ready in own.glob("*" + READY):  # last: FFCx asks for a form's source first
        (own / ready.name.removesuffix(".cached")).touch()
    return own


def _finished(folder: Path) -> Iterator[Path]:
    """The library and the mark of every finished form."""
    names = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    for name in sorted(names):
        form, ending = name.partition(".")[0], name[name.find(".") :]
        if ending == READY or (ending.endswith(".so") and form + READY in names):
            yield folder / name


def _publish(own: Path, folder: Path) -> None:
    """Rename what was compiled in `own` into `folder`, the mark last, and remove what killed processes have left."""
    with contextlib.suppress(OSError):  # another file system, or no space: the next process compiles again
        for ready in own.glob("*" + READY):
            if ready.is_symlink():
                continue
            for library in own.glob(ready.name.removesuffix(READY) + ".*so"):
                with library.open("rb") as file:
                    os.fsync(file.fileno())  # a machine that stops must not leave a renamed library without content
                os.replace(library, folder / library.name)
            os.replace(ready, folder / ready.name)
        for left in folder.glob(ASIDE + "*"):
            if time.time() - left.stat().st_mtime > ABANDONED_SECONDS:
                shutil.rmtree(left, ignore_errors=True)
