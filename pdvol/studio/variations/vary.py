"""What `--vary` says: a range, a range with a number of values, or a list."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.runs.scene_file import parse_value
from pdvol.studio.variations.variation import value_text

MOST_VARIATIONS = 10_000  # runs that one folder can list and one command line can start
NEARLY_ZERO = 1e-9  # of a range's larger end: rounding of a value that is meant to be zero


@dataclass(frozen=True)
class Vary:
    """What one `--vary` says.

    Attributes
    ----------
    name : of a setting
    values : those of a grid; empty for a range without a number of values
    ends : of a range, None for a list
    """

    name: str
    values: tuple[Any, ...]
    ends: tuple[float, float] | None = None

    def at(self, fraction: float) -> Any:
        """The value at a fraction in [0, 1) of the range, or of the list."""
        if self.ends is None:
            return self.values[int(fraction * len(self.values))]
        return between(self.ends, fraction)


def between(ends: tuple[float, float], fraction: float) -> Any:
    """The value at a fraction of a range, as it is written on a command line."""
    value = ends[0] + fraction * (ends[1] - ends[0])
    return stored_value(0.0 if abs(value) < NEARLY_ZERO * max(map(abs, ends)) else value)


def stored_value(value: Any) -> Any:
    """The value that a run has after it went through its command line."""
    return parse_value(value_text(value))


def parse_vary(word: str) -> Vary:
    """`offset=-0.1:0.1:9` (9 values from -0.1 to 0.1), `offset=-0.1:0.1` (a range for `--sample` and `--seek`) or
    `spin=0,2,4` (values, read as `--set` does).

    Raises
    ------
    InputError
        It is none of these.
    """
    name, equals, text = word.partition("=")
    if not equals or not text.strip() or not name.replace(".", "_").isidentifier():
        raise InputError(f"--vary {word}: write name=A:B:N, name=A:B or name=value,value,...")
    parts = text.split(":")
    numbers = [_number(parse_value(part.strip())) for part in parts]
    if len(parts) in (2, 3) and numbers[0] is not None and numbers[1] is not None:
        ends = numbers[0], numbers[1]
        if not all(math.isfinite(end) for end in ends):
            raise InputError(f"--vary {word}: the ends of a range are finite numbers")
        if len(parts) == 2:
            return Vary(name, (), ends)
        if not parts[2].strip().isdigit() or not 2 <= int(parts[2]) <= MOST_VARIATIONS:
            raise InputError(f"--vary {word}: N in A:B:N is a whole number from 2 to {MOST_VARIATIONS}")
        return Vary(name, tuple(between(ends, fraction) for fraction in np.linspace(0.0, 1.0, int(parts[2]))), ends)
    values = tuple(parse_value(part) for part in _split(text))
    if any(value == "" for value in values):
        raise InputError(f"--vary {word}: a value is empty")
    return Vary(name, values)


def _split(text: str) -> list[str]:
    """At commas that are in no brackets: a value may be a vector."""
    return [part.strip() for part in re.split(r",(?![^(\[]*[)\]])", text)]


def _number(value: Any) -> float | None:
    """A whole number stays one."""
    return value if isinstance(value, int | float) and not isinstance(value, bool) else None


def parsed_varies(words: Sequence[str], taken: Mapping[str, str] = MappingProxyType({})) -> list[Vary]:
    """All `--vary` of a command line.

    Parameters
    ----------
    taken : settings that the command has an option of its own for, with that option

    Raises
    ------
    InputError
        One is wrong, or taken, or a name comes twice.
    """
    varies = [parse_vary(word) for word in words]
    for vary, word in zip(varies, words, strict=True):
        if vary.name in taken:
            raise InputError(f"--vary {word}: give {vary.name} by {taken[vary.name]}")
        if sum(other.name == vary.name for other in varies) > 1:
            raise InputError(f"--vary names {vary.name} twice; give all its values in one")
    return varies
