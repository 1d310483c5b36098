"""One choice of settings of a scene: its name, the words of its command line, and its place in JSON."""

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.runs.scene_file import Shot, parse_value
from pdvol.scene import Pascal, Relative

LONGEST_FOLDER_NAME = 120  # characters of a folder's name: file systems allow 255 bytes


@dataclass(frozen=True)
class Base:
    """What all variations of a scene share.

    Attributes
    ----------
    scene : the scene file
    settings : (name, value) of what `--set` gave for all of them
    duration : of the shot [s]
    dt : the scene's time step [s]
    """

    scene: Path
    settings: tuple[tuple[str, Any], ...]
    duration: float
    dt: float

    @classmethod
    def of(cls, shot: Shot) -> "Base":
        """That of a shot; InputError where it was made in memory."""
        if shot.file is None:
            raise InputError("many runs need a scene file, which their processes load; save the scene as one")
        scene = shot.scene
        return cls(shot.file, tuple(shot.parameters.items()), scene.steps * scene.dt, scene.dt)


@dataclass(frozen=True)
class Variation:
    """Settings that differ from the scene's own, and how its levels are made.

    Attributes
    ----------
    changes : (name, value), sorted by name
    method : "progressive", or "direct", whose levels are computed alone
    """

    changes: tuple[tuple[str, Any], ...] = ()
    method: str = "progressive"

    @classmethod
    def of(cls, changes: Mapping[str, Any], method: str = "progressive") -> "Variation":
        """A variation with these changes."""
        return cls(tuple(sorted(changes.items())), method)

    @property
    def name(self) -> str:
        """The name of its folder: unique, without characters that a shell or a file system reads otherwise."""
        parts = [f"{name}-{value_text(value)}" for name, value in self.changes]
        if self.method != "progressive":
            parts.append(self.method)
        text = "_".join(parts).replace("Relative", "rel").replace("(", "").replace(")", "")
        name = re.sub(r"[^A-Za-z0-9._+-]+", "-", text) or "default"
        if len(name) <= LONGEST_FOLDER_NAME:
            return name
        return f"{name[:LONGEST_FOLDER_NAME]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"

    def label(self, level: int | None = None) -> str:
        """For plots and tables: `level 1, dt 0.02, tolerance Relative(0.01)`."""
        parts = [] if level is None else [f"level {level}{' alone' if self.method == 'direct' else ''}"]
        parts += [f"{name} {short_text(value_text(value))}" for name, value in self.changes]
        return ", ".join(parts) or "the scene's settings"

    def steps(self, base: Base) -> int:
        """Steps of the shot with this time step."""
        return max(1, round(base.duration / dict(self.changes).get("dt", base.dt)))

    def words(self, base: Base, levels: str) -> list[str]:
        """The words after `pdvol run SCENE.py`, without the run folder."""
        words = ["--levels", levels, "--steps", str(self.steps(base))]
        if self.method != "progressive":
            words += ["--method", self.method]
        for name, value in {**dict(base.settings), **dict(self.changes)}.items():
            words += ["--set", f"{name}={value_text(value)}"]
        return words

    def as_json(self) -> dict:
        """For `study.json`."""
        return {"changes": {name: value_text(value) for name, value in self.changes}, "method": self.method}

    @classmethod
    def from_json(cls, entry: Mapping) -> "Variation":
        """What `as_json` gave."""
        return cls.of(
            {name: parse_value(text) for name, text in entry["changes"].items()}, entry.get("method", "progressive")
        )


def value_text(value: Any) -> str:
    """A value as `--set` reads it: `parse_value` gives the same value, to the last bit."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    match value:
        case Relative() | Pascal():
            return f"{type(value).__name__}({value_text(number(value)).removesuffix('.0')})"
        case str():
            return value if parse_value(value) == value else repr(value)
        case float():
            return repr(value).replace("inf", "1e999")  # which is a literal
        case tuple() | list():
            parts = [repr(part) if isinstance(part, str) else value_text(part) for part in value]
            return f"({','.join(parts)}{',' if len(parts) == 1 else ''})"
    return str(value)


def short_text(text: str) -> str:
    """What `value_text` gives, for people: numbers of six digits."""
    return re.sub(r"-?\d+\.\d+(e[-+]?\d+)?", lambda found: f"{float(found[0]):.6g}", text)


def number(value: Any) -> float | None:
    """The number in a value, also in a `Relative` one or in pascal; None where it has none."""
    if isinstance(value, Relative | Pascal):
        value = value.fraction if isinstance(value, Relative) else value.pascals
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def times(value: Any, factor: float) -> Any:
    """A number, or a `Relative` one or one in pascal, times a factor."""
    product = (number(value) or 0.0) * factor
    if math.frexp(factor)[0] != 0.5:  # by a power of two it is exact
        product = float(f"{product:.15g}")  # 0.1 * 0.1 is 0.01 on every page
    return type(value)(product) if isinstance(value, Relative | Pascal) else product


def length(metres: float | None) -> str:
    """A length for people: 5 mm, 0.31 mm, 1.2 m."""
    if metres is None:
        return "an unknown distance"
    for unit, factor in (("m", 1.0), ("cm", 1e2), ("mm", 1e3), ("um", 1e6)):
        if metres * factor >= 1.0 or unit == "um":
            return f"{metres * factor:.2g} {unit}" if metres * factor < 99.5 else f"{metres * factor:.0f} {unit}"
    raise AssertionError
