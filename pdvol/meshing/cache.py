"""A cache of meshes in `${XDG_CACHE_HOME:-~/.cache}/pdvol/meshes`, keyed by the content they were built from."""

import contextlib
import fcntl
import hashlib
import os
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

MOST_WAIT = 600.0  # seconds for another process that builds the same mesh: few take as long
WAIT_POLL = 0.05  # seconds between looks at its lock


def default_folder() -> Path:
    """The cache's folder."""
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "pdvol" / "meshes"


def installed(packages: Iterable[str]) -> dict[str, str]:
    """Versions of those of some packages that are installed."""
    found = {}
    for name in packages:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def content_key(*parts: np.ndarray | str | int) -> str:
    """A hash of arrays (with their shapes and types), texts and numbers."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(f"{part.dtype.str}{part.shape}".encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        else:
            digest.update(repr(part).encode())
        digest.update(b"\0")
    return digest.hexdigest()[:32]


def fetch(folder: Path, key: str, build: Callable[[], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """The arrays stored under `key`, or those that `build` returns, which are then stored. Of several processes that
    need them at once one builds, and the others wait for it.

    An entry whose checksums do not fit is built again. A folder that cannot be written to is no error.
    """
    path = folder / f"{key}.npz"
    found = _stored(path)
    if found is not None:
        return found
    with _builder(folder / f"{key}.lock"):
        found = _stored(path)
        if found is not None:
            return found
        arrays: dict[str, Any] = build()
        with contextlib.suppress(OSError):
            folder.mkdir(parents=True, exist_ok=True)
            descriptor, aside = tempfile.mkstemp(dir=folder, prefix=key, suffix=".partial")
            try:
                with os.fdopen(descriptor, "wb") as file:
                    np.savez(file, **arrays)
                os.replace(aside, path)
            except BaseException:
                with contextlib.suppress(OSError):
                    os.unlink(aside)
                raise
        return arrays


def _stored(path: Path) -> dict[str, np.ndarray] | None:
    with contextlib.suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in data.files}
    return None


@contextlib.contextmanager
def _builder(path: Path) -> Iterator[None]:
    """For one process at a time, as far as the folder can be written to. The lock falls with its process; after
    `MOST_WAIT` a process builds beside it.
    """
    with contextlib.ExitStack() as held:
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            file = held.enter_context(open(path, "a"))
            end = time.monotonic() + MOST_WAIT
            while time.monotonic() < end:
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    held.callback(path.unlink, missing_ok=True)  # whoever waits has the file open, and looks again
                    break
                except BlockingIOError:
                    time.sleep(WAIT_POLL)
        yield
