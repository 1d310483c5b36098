"""Files of code that a user has run, so that one that a stored run or a wedge names is not run unseen: these may come
from anywhere.

They are kept in the user's own state folder, one line a file: the SHA-256 of its path and content. A file that has
changed since, or lies elsewhere, is not known. Nor are texts that are given to it, as names of other files, until they
were given to it here.
"""

import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pdvol.errors import InputError

_here: set[str] = set()  # what this process knows besides, where the list cannot be written
_trusts: list[bool] = [False]  # whether the command line has --trust


@contextmanager
def trusting(everything: bool) -> Iterator[None]:
    """While it lasts, all files are known if `everything` is true: the user says so."""
    _trusts.append(everything)
    try:
        yield
    finally:
        _trusts.pop()


def allow(file: Path, given: Any = None, trusted: bool = True) -> None:
    """Note that the user has a file of code run, or require it.

    Parameters
    ----------
    given : settings or other values, of which texts count: what is given to the code
    trusted : whether the user names the file

    Raises
    ------
    InputError
        The file cannot be read; or it is not known as it is now, and not trusted.
    """
    texts = _texts(given)
    try:
        data = os.fsencode(file.resolve()) + b"\0" + file.read_bytes()
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror or error}") from error
    line = hashlib.sha256(data + (b"\0" + json.dumps(texts).encode() if texts else b"")).hexdigest()
    if not (trusted or _trusts[-1] or _is_known(line)):
        with_it = f" with {', '.join(map(repr, texts))}" if texts else ""
        raise InputError(f"the file {file} has not run here as it is now{with_it}: look at it, then add --trust")
    _note(line)


def note_run(run: Path, file: Path) -> None:
    """Note that the user has made a run of a scene file here."""
    _note(_run_line(run, file))


def is_own_run(run: Path, file: Path) -> bool:
    """Whether the user has made this run of this scene file here, who may have edited the file since."""
    return _is_known(_run_line(run, file))


def _run_line(run: Path, file: Path) -> str:
    return hashlib.sha256(os.fsencode(run.resolve()) + b"\0of\0" + os.fsencode(file.resolve())).hexdigest()


def _is_known(line: str) -> bool:
    with suppress(OSError):
        return line in _here or line in _list().read_text(errors="replace").split()
    return False


def _note(line: str) -> None:
    if _is_known(line):
        return
    _here.add(line)
    with suppress(OSError):
        _list().parent.mkdir(parents=True, exist_ok=True)
        with open(_list(), "a") as known:
            known.write(line + "\n")


def _texts(given: Any) -> list[str]:
    """The texts within values, sorted, those of a dictionary after their names."""
    if isinstance(given, dict):
        return sorted(f"{name}={text}" for name, value in given.items() for text in _texts(value))
    if isinstance(given, list | tuple):
        return [text for value in given for text in _texts(value)]
    return [given] if isinstance(given, str) else []


def _list() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "pdvol" / "scenes"
