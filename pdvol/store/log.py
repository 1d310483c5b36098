"""`log.jsonl`: one JSON object a line, one line per level and step, in the order in which they were solved."""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path

from pdvol.errors import InputError
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


def log_line(record: dict) -> bytes:
    """One record as a line of the log."""
    return (json.dumps(jsonable(record)) + "\n").encode()


def write_known(source: Path, target: Path, counts: Mapping[int, int]) -> None:
    """Write the whole records of a log that belong to the first so many states of each level."""
    write_log(target, (r for r in read_log(source) if r.get("step", 0) < counts.get(r.get("level", 0), 0)))


def write_log(path: Path, records: Iterable[dict]) -> None:
    """Replace the log by these records."""
    write_bytes(path, b"".join(log_line(record) for record in records))
