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
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TextIO, TypeVar

import numpy as np

from pdvol.errors import InputError, SimulationError

TEMPORARY = ".tmp"  # the end of temporary names, which a later writer removes
LOCK_ATTEMPTS = 5  # to take a lock: a process that checks whether a run is in use holds it for an instant
LOCK_PAUSE = 0.02  # seconds between attempts
STORED_LISTS = {"obstacles": "obstacles", "render": "render meshes"}  # names of a run's lists in messages


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


def require_no_link_out(folder: Path, root: Path | None = None) -> None:
    """InputError where a link in a folder, which may be from elsewhere, leads out of it."""
    root = folder.resolve() if root is None else root
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_symlink():
                if not Path(entry.path).resolve().is_relative_to(root):
                    raise InputError(f"{entry.path} is a link that leads out of the folder; put there what it links to")
            elif entry.is_dir():
                require_no_link_out(Path(entry.path), root)


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


def mapped_array(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    """A float64 array of a known shape in a .npy file; its numbers are read where they are used.

    Raises
    ------
    InputError
        When the file is missing, cut short or holds another array.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)  # so that no damaged header requests memory
        if array.shape != shape or array.dtype != np.float64:
            raise ValueError(f"it is no float64 array of shape {shape}")
    except FileNotFoundError as error:
        raise InputError(f"{path} is missing") from error
    except Exception as error:  # damaged files fail in any way
        raise InputError(f"{path} is damaged or cut short ({' '.join(str(error).split())})") from error
    return array


def read_array(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    """The same in memory; InputError also where it holds numbers that are not finite."""
    array = np.array(mapped_array(path, shape))
    if not np.isfinite(array).all():
        raise InputError(f"{path} holds numbers that are not finite")
    return array


def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Read named arrays of a .npz file; InputError when it is missing, damaged or lacks one of `names`."""
    try:
        with zipfile.ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
        if unpacked > path.stat().st_size:  # pdvol's are not compressed; this one could fill the memory
            raise ValueError("compressed")
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except FileNotFoundError as error:
        raise InputError(f"{path} is missing") from error
    except Exception as error:  # damaged files fail in any way
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


Made = TypeVar("Made")


def write_list(folder: Path, name: str, entries: Sequence[dict], arrays: Sequence[Mapping[str, np.ndarray]]) -> None:
    """Write `<name>.json`, a list of JSON objects, and `<name>/<i>.npz`, the arrays of each. The list is the last: once
    it is there, every file that it names is.
    """
    (folder / name).mkdir(exist_ok=True)
    for i, named in enumerate(arrays):
        write_arrays(folder / name / f"{i}.npz", **named)
    write_json(folder / f"{name}.json", {name: list(entries)})


def read_list(folder: Path, name: str, make: Callable[[int, dict, dict[str, np.ndarray]], Made]) -> tuple[Made, ...]:
    """What `make` gives of the number, the JSON object and the arrays of each entry; none where no list was written.

    Raises
    ------
    InputError
        A file is damaged; a run's states do not depend on it.
    """
    file = folder / f"{name}.json"
    try:
        entries = read_json(file).get(name, [])
        return tuple(make(i, entry, read_arrays(folder / name / f"{i}.npz", ())) for i, entry in enumerate(entries))
    except FileNotFoundError:
        return ()
    except (KeyError, TypeError, AttributeError) as error:
        raise InputError(
            f"{file} is no list of {STORED_LISTS[name]}; the stored states do not depend on it: remove it, or resume"
            " the run"
        ) from error


def jsonable(value: Any) -> Any:
    """A value in JSON's types. Numbers that are not finite become null, as JSON has none; dataclasses, objects."""
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
