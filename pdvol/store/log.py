"""`log.jsonl`: one JSON object a line, one line per level and step, in the order in which they were solved."""

import json
import os
from collections.abc import Callable
from pathlib import Path

from pdvol.errors import InputError, SimulationError
from pdvol.store.files import jsonable, write_bytes


def read_log(path: Path) -> list[dict]:
    """All whole lines. A last line without its end, left by a kill, is ignored.

    Raises
    ------
    InputError
        When a whole line is no JSON object; the stored states do not depend on it.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return []
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror}") from error
    records = []
    for number, line in enumerate(text.split(b"\n")[:-1], start=1):
        try:
            record = json.loads(line)
        except (ValueError, RecursionError):
            record = None
        if not isinstance(record, dict) or not all(isinstance(record.get(key, 0), int) for key in ("level", "step")):
            raise InputError(
                f"{path}, line {number}, is not a JSON object of a level and step; the stored states are unaffected:"
                " remove that line"
            )
        records.append(record)
    return records


def keep_log(path: Path, keep: Callable[[dict], bool]) -> None:
    """Drop the records that `keep` refuses, and a torn last line."""
    lines = [log_line(record) for record in read_log(path) if keep(record)]
    text = b"".join(lines)
    if not path.exists() or path.read_bytes() != text:
        write_bytes(path, text)


def log_line(record: dict) -> bytes:
    """One record as a line of the log."""
    return (json.dumps(jsonable(record)) + "\n").encode()


class LogFile:
    """The log, open for appending. Each record is one write to the system: a kill right after it loses nothing."""

    def __init__(self, path: Path):
        self.path = path
        self._file = open(path, "ab", buffering=0)  # closed by close()

    def append(self, record: dict) -> None:
        """Add a record; SimulationError where the disk cannot be written, and the log is then as before."""
        data = log_line(record)
        end = os.fstat(self._file.fileno()).st_size
        try:
            written = self._file.write(data)
            reason = None if written == len(data) else "only a part of the line was written"
        except OSError as error:
            reason = error.strerror or str(error)
        if reason:
            self._file.truncate(end)  # a full disk must not leave half a line in front of the next one
            raise SimulationError(f"cannot write {self.path}: {reason}; everything stored before it is kept")

    def close(self) -> None:
        """Close the file."""
        self._file.close()
