"""A PolyFEM scene as it is read: its JSON over that of its `common` file, and what of it has no counterpart."""

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pdvol.errors import InputError, SeveralErrors

MOST_COMMON = 20  # files that inherit from each other: more are a circle
SHOWN_VALUE = 60  # characters of a value in a message
IGNORED = (
    "output", "tests", "root_path", "units.characteristic_length", "solver.linear", "solver.adjoint_linear",
    "solver.nonlinear", "solver.augmented_lagrangian", "solver.max_threads", "solver.contact.CCD",
    "solver.contact.friction_convergence_tol", "solver.contact.initial_barrier_stiffness",
    "solver.contact.barrier_stiffness", "solver.advanced", "space.advanced", "authors", "preset",
)  # fmt: skip
"""Keys that say how PolyFEM solves or what it writes: they do not change what is simulated."""


@dataclass
class Reading:
    """What was found on the way.

    Attributes
    ----------
    file : of the scene
    refused : one line for each thing that pdvol does not have
    ignored : keys that were passed over
    notes : one line for each difference between the two programs that the scene meets
    """

    file: Path
    refused: list[str] = field(default_factory=list)
    ignored: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def refuse(self, path: str, value: Any, lack: str) -> None:
        """Note one thing that pdvol does not have."""
        text = json.dumps(value, default=str)
        shown = text if len(text) <= SHOWN_VALUE else f"{text[: SHOWN_VALUE - 3]}..."
        self.refused.append(f"{path} = {shown}: {lack}")

    def check(self) -> None:
        """SeveralErrors with a line for each thing that was refused."""
        if self.refused:
            raise SeveralErrors(f"{self.file.name}: {line}" for line in dict.fromkeys(self.refused))


class Section:
    """An object of the JSON. Keys that nobody asks for are refused at the end, unless `IGNORED` has them."""

    def __init__(self, reading: Reading, path: str, values: Any):
        self.reading, self.path = reading, path
        if not isinstance(values, dict):
            reading.refuse(path or "the file", values, "an object {...} is expected here")
            values = {}
        self.values: dict[str, Any] = values
        self._asked: set[str] = set()

    def at(self, key: str) -> str:
        """The path of a key, as in `contact.dhat`."""
        return f"{self.path}.{key}" if self.path else key

    def refuse(self, key: str, lack: str) -> None:
        """Note that pdvol does not have what a key says."""
        self.reading.refuse(self.at(key), self.values.get(key), lack)

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a key; null counts as left out."""
        self._asked.add(key)
        value = self.values.get(key)
        return default if value is None else value

    def number(self, key: str, default: float) -> float:
        """A number."""
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            self.refuse(key, "only a number is understood here")
            return default
        return float(value)

    def whole(self, key: str, default: int) -> int:
        """A whole number."""
        value = self.get(key, default)
        if isinstance(value, bool) or not isinstance(value, int):
            self.refuse(key, "only a whole number is understood here")
            return default
        return value

    def flag(self, key: str, default: bool) -> bool:
        """True or false."""
        value = self.get(key, default)
        if not isinstance(value, bool):
            self.refuse(key, "only true or false is understood here")
            return default
        return value

    def only(self, key: str, accepted: tuple, lack: str) -> None:
        """Refuse any value but these (and none)."""
        value = self.get(key)
        if value is not None and value not in accepted:
            self.refuse(key, lack)

    def section(self, key: str) -> "Section":
        """An object within; empty where left out."""
        return Section(self.reading, self.at(key), self.get(key, {}))

    def sections(self, key: str) -> list["Section"]:
        """The objects of a list; a single one may stand without its list."""
        value = self.get(key, [])
        listed = value if isinstance(value, list) else [value]
        return [Section(self.reading, f"{self.at(key)}[{i}]", entry) for i, entry in enumerate(listed)]

    def close(self) -> None:
        """Refuse the keys that nobody has read."""
        for key, value in self.values.items():
            if key in self._asked or value is None:
                continue
            if self.at(key) in IGNORED:
                self.reading.ignored.append(self.at(key))
            else:
                self.refuse(key, "pdvol has no counterpart of this key")


def read_document(file: Path) -> Section:
    """The JSON of a scene over that of the files it inherits from by `common`.

    Raises
    ------
    InputError
        A file is missing or no JSON, or the files inherit in a circle.
    """
    merged: dict = {}
    for values in _chain(file):
        merged = _over(merged, values)
    merged.pop("common", None)
    return Section(Reading(file), "", merged)


def _chain(file: Path) -> Iterator[dict]:
    """The values of a file under those that it inherits, the file itself first."""
    for _ in range(MOST_COMMON):
        values = _parsed(file)
        yield values
        common = values.get("common")
        if not common:
            return
        if not isinstance(common, str):
            raise InputError(f"{file.name}: common = {common!r} must be the path of a JSON file")
        file = file.parent / common
    raise InputError(f"{file.name}: more than {MOST_COMMON} files inherit from each other by common: is it a circle?")


def _parsed(file: Path) -> dict:
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror}); check the path") from error
    except (ValueError, RecursionError) as error:  # the first one covers broken JSON and broken UTF-8
        raise InputError(f"{file}: is not JSON: {' '.join(str(error).split())[:160]}") from error
    if not isinstance(values, dict):
        raise InputError(f"{file}: a PolyFEM scene is an object {{...}}, not {type(values).__name__}")
    return values


def _over(first: dict, second: dict) -> dict:
    """The keys of both; where both have one, that of `first`, and objects key by key."""
    merged = dict(second)
    for key, value in first.items():
        below = merged.get(key)
        merged[key] = _over(value, below) if isinstance(value, dict) and isinstance(below, dict) else value
    return merged
