"""Files that survive a kill at any instant, and checks of files that are read.

A file is written to a temporary name in its own folder, synced to the disk and renamed over its final name: a reader
finds the old file, or the new one, or none, never half of one. Two kinds only grow, states and the log: their readers
ignore a part of a record at the end. Arrays are never unpickled.
"""

import contextlib
import dataclasses
import errno
import fcntl
import io
import json
import math
import os
import time
import zipfile
import zlib
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from pdvol.errors import InputError, SimulationError

TEMPORARY = ".tmp"  # the end of temporary names, which a later writer removes
LOCK_ATTEMPTS = 5  # to take a lock: a process that checks whether a run is in use holds it for an instant
LOCK_PAUSE = 0.02  # seconds between attempts
_UNREADABLE = (
    OSError,
    ValueError,
    EOFError,
    KeyError,
    SyntaxError,
    TypeError,
    AttributeError,
    MemoryError,
    RecursionError,
    OverflowError,
    NotImplementedError,
    RuntimeError,
    zipfile.BadZipFile,
    zlib.error,
)


def write_bytes(path: Path, data: bytes | memoryview) -> None:
    """Replace `path` by `data`, whole or not at all.

    Raises
    ------
    SimulationError
        When the disk is full or cannot be written; what was stored before is intact.
    """
    aside = path.with_name(f".{path.name}{TEMPORARY}")
    try:
        with open(aside, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
        sync_file(path.parent)
    except OSError as error:
        with contextlib.suppress(OSError):
            aside.unlink(missing_ok=True)
        raise not_written(path, error) from error


def append(path: Path, data: bytes, begin: int | None = None) -> None:
    """Write `data` at the end of a file, or from byte `begin` on, where only a part of a record follows.

    Raises
    ------
    SimulationError
        When the disk is full or cannot be written; the file then ends where `data` would begin.
    """
    try:
        file = os.open(path, os.O_WRONLY)
        try:
            begin = os.fstat(file).st_size if begin is None else begin
            if os.pwrite(file, data, begin) < len(data):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        finally:
            os.close(file)
    except OSError as error:
        with contextlib.suppress(OSError):
            if begin is not None:
                os.truncate(path, begin)
        raise not_written(path, error) from error


def not_written(path: Path, error: OSError) -> SimulationError:
    """The error of a file that cannot be written."""
    return SimulationError(f"cannot write {path}: {error.strerror or error}; everything stored before it is kept")


def require_room(path: Path, size: int) -> None:
    """SimulationError unless a file of `size` bytes can be written as `path`, which is left empty.

    HDF5 ends the process where its file cannot grow, so the free space is checked before.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path, "wb") as file:
            os.posix_fallocate(file.fileno(), 0, size)
            file.truncate(0)
    except OSError as error:
        with contextlib.suppress(OSError):
            path.unlink(missing_ok=True)
        raise SimulationError(
            f"cannot write {path.parent / path.name.removeprefix('.').removesuffix(TEMPORARY)}: {error.strerror}"
        ) from error


def make_folder(path: Path) -> None:
    """Make a folder where there is none; InputError where that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path} cannot be made: {error.strerror or error}") from error


def require_place(folder: Path) -> None:
    """InputError where no files can be written into a folder, or where it is not there and cannot be made."""
    there = next(p for p in (folder.absolute(), *folder.absolute().parents) if os.path.exists(p))
    if not there.is_dir():
        raise InputError(f"{there} is a file, not a folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"{there} cannot be written; choose a folder of yours")


def require_writable(file: Path) -> None:
    """InputError where a file cannot be written."""
    if file.is_dir() or not os.access(file.parent, os.W_OK):
        raise InputError(f"{file} cannot be written; choose another file in a folder of yours")


def sync_file(path: Path) -> None:
    """Make a file, or the names in a folder, outlive a power cut."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_array(path: Path, array: np.ndarray) -> None:
    """Write one array as .npy."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    write_bytes(path, buffer.getbuffer())


def write_arrays(path: Path, **arrays: np.ndarray) -> None:
    """Write named arrays as .npz, whose entries carry checksums."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]  # numpy's hints take any name for `allow_pickle`
    write_bytes(path, buffer.getbuffer())


def write_json(path: Path, value: dict) -> None:
    """Write one JSON object, indented for people."""
    write_bytes(path, (json.dumps(jsonable(value), indent=2) + "\n").encode())


def read_array(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    """Read a float64 array of a known shape.

    Raises
    ------
    InputError
        When the file is missing, cut short, of another shape or holds numbers that are not finite.
    """
    if not path.exists():
        raise InputError(f"{path} is missing")
    if not is_whole(path, shape):  # before a damaged header can request memory
        raise InputError(f"{path} is damaged or cut short (it is no float64 array of shape {shape})")
    try:
        array = np.load(path, allow_pickle=False)
    except _UNREADABLE as error:
        raise InputError(f"{path} is damaged or cut short ({error})") from error
    if not np.isfinite(array).all():
        raise InputError(f"{path} holds numbers that are not finite")
    return array


def is_whole(path: Path, shape: tuple[int, ...]) -> bool:
    """Whether a .npy file has the header and the length of a float64 array of this shape; its numbers are not read."""
    try:
        with open(path, "rb") as file:
            version = np.lib.format.read_magic(file)
            read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}[
                version
            ]
            stored, _, dtype = read_header(file)
            payload = os.fstat(file.fileno()).st_size - file.tell()
    except _UNREADABLE:
        return False
    return stored == shape and dtype == np.float64 and payload == 8 * math.prod(shape)


def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Read named arrays of a .npz file; InputError when it is missing, damaged or lacks one of `names`."""
    try:
        with zipfile.ZipFile(path) as archive:
            if (
                sum(entry.file_size for entry in archive.infolist()) > path.stat().st_size
            ):  # pdvol's are not compressed; this one could fill the memory
                raise ValueError("compressed")
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except FileNotFoundError as error:
        raise InputError(f"{path} is missing") from error
    except _UNREADABLE as error:  # a plain .npy array in its place is no context manager, for example
        raise InputError(f"{path} is damaged or cut short ({error})") from error
    missing = [name for name in names if name not in arrays]
    if missing:
        raise InputError(f"{path} lacks the arrays {missing}")
    return arrays


def read_json(path: Path) -> dict:
    """Read one JSON object.

    Raises
    ------
    InputError
        The file cannot be read, or holds something else.
    FileNotFoundError
        There is no such file; the caller knows whether that is an error.
    """
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"{path} cannot be read as JSON ({error})") from error
    if not isinstance(value, dict):
        raise InputError(f"{path} does not hold a JSON object")
    return value


def jsonable(value: Any) -> Any:
    """The same value in JSON's types. Numbers that are not finite become null, for JSON has none; dataclasses become
    objects.
    """
    if isinstance(value, dict):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [jsonable(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return jsonable(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, Path):
        return str(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: jsonable(getattr(value, f.name)) for f in dataclasses.fields(value)}
    raise InputError(
        f"{value!r} of type {type(value).__name__} cannot be stored as JSON; use numbers, text, lists or dataclasses of"
        " them"
    )


def lock(path: Path, exclusive: bool = True) -> TextIO | None:
    """Take a lock that falls with the process; returns the open file, or None when another process holds it."""
    file = open(path, "a" if exclusive else "r")  # it stays open for as long as the lock is held
    for attempt in range(LOCK_ATTEMPTS):
        try:
            fcntl.flock(file, (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH) | fcntl.LOCK_NB)
            return file
        except BlockingIOError:
            if exclusive and attempt + 1 < LOCK_ATTEMPTS:
                time.sleep(LOCK_PAUSE)
    file.close()
    return None
