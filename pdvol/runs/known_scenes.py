"""Scene files that a user has run, so that a stored run's file is not run unseen: `run.json` may come from anywhere.

They are kept in the user's own state folder, one line a file: the SHA-256 of its path and content. A file that has
changed since, or lies elsewhere, is not known.
"""

import hashlib
import os
from contextlib import suppress
from pathlib import Path

from pdvol.errors import InputError


def remember(file: Path) -> None:
    """Note that the user has this scene file run. Where that cannot be stored, it stays unknown."""
    line = _line(file)
    with suppress(OSError):
        if line not in _known():
            _list().parent.mkdir(parents=True, exist_ok=True)
            with open(_list(), "a") as known:
                known.write(line + "\n")


def require_known(file: Path) -> None:
    """InputError where a scene file holds code that the user has not run yet as it is now."""
    if file.suffix.lower() != ".json" and _line(file) not in _known():
        raise InputError(f"its scene file {file} has not run here as it is now: look at it, then add --run-scene")


def _line(file: Path) -> str:
    try:
        return hashlib.sha256(os.fsencode(file.resolve()) + b"\0" + file.read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror or error}") from error


def _known() -> set[str]:
    with suppress(OSError):
        return set(_list().read_text(errors="replace").split())
    return set()


def _list() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "pdvol" / "scenes"
