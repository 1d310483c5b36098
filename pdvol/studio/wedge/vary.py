"""Which variations there are: what `--vary`, `--sample` and `--jitter` say."""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.runs.scene_file import parse_value
from pdvol.studio.wedge.variation import Variation, value_text

MOST_VARIATIONS = 10_000  # runs that one folder can list and one command line can start
NEARLY_ZERO = 1e-9  # of a range's larger end: rounding of a value that is meant to be zero
TAKEN = {"steps": "--steps", "jitter": "--jitter"}
"""Settings that a wedge has an option for, with that option."""


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
        """The value at a fraction in [0, 1] of the range, or in [0, 1) of the list."""
        if self.ends is None:
            return self.values[int(fraction * len(self.values))]
        low, high = self.ends
        if fraction in (0.0, 1.0):
            return self.ends[int(fraction)]
        value = float(f"{low + fraction * (high - low):.15g}")  # of 0.1 to 0.7 it is 0.3, not 0.30000000000000004
        value = value if abs(value) >= NEARLY_ZERO * max(abs(low), abs(high)) else 0.0
        return int(value) if value.is_integer() and isinstance(low, int) and isinstance(high, int) else value


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
    first, *others = (part.strip() for part in text.split(":"))
    ends = [parse_value(end) for end in (first, *others[:1])]
    if len(others) in (1, 2) and all(type(end) in (int, float) for end in ends):
        if not all(math.isfinite(end) for end in ends):
            raise InputError(f"--vary {word}: the ends of a range are finite numbers")
        found = Vary(name, (), (ends[0], ends[1]))
        if len(others) == 1:
            return found
        if not others[1].isdigit() or not 2 <= int(others[1]) <= MOST_VARIATIONS:
            raise InputError(f"--vary {word}: N in A:B:N is a whole number from 2 to {MOST_VARIATIONS}")
        return Vary(name, tuple(found.at(x) for x in np.linspace(0.0, 1.0, int(others[1]))), found.ends)
    parts = re.split(r",(?![^(\[]*[)\]])", text)  # at commas that are in no brackets: a value may be a vector
    values = tuple(parse_value(part.strip()) for part in parts)
    if "" in values:
        raise InputError(f"--vary {word}: a value is empty")
    return Vary(name, values)


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


def chosen_variations(
    varies: Sequence[Vary], sample: int | None = None, jitter: float | None = None, seed: int = 0
) -> list[Variation]:
    """The grid of all values, or a sample of the ranges.

    Parameters
    ----------
    sample : number of points of Halton's sequence; they fill the ranges evenly, and a larger sample begins with the
        smaller one. A grid when None.
    jitter : [m/s] each body's initial velocity gets a small random one of this speed, another one in each variation
    seed : of the sample

    Raises
    ------
    InputError
        A range has no number of values, there are too many variations, or none.
    """
    if sample is not None and not 1 <= sample <= MOST_VARIATIONS:
        raise InputError(f"--sample {sample}: give a number from 1 to {MOST_VARIATIONS}")
    if jitter is not None and not (math.isfinite(jitter) and jitter > 0.0):
        raise InputError(f"--jitter {jitter:g}: give a speed above zero [m/s]")
    if sample is not None and not varies and jitter is None:
        raise InputError("--sample needs --vary NAME=A:B or --jitter: nothing would differ")
    if sample is None and not varies:
        raise InputError("say what differs: --vary NAME=A:B:N" + (", or how many: --sample N" if jitter else ""))
    names = [vary.name for vary in varies]
    rows = _grid(varies) if sample is None else _sample(varies, sample, seed)
    found = [dict(zip(names, row, strict=True)) for row in rows]
    if jitter is not None:
        found = [{**changes, "jitter": (jitter, number)} for number, changes in enumerate(found)]
    return list(dict.fromkeys(Variation.of(changes) for changes in found))  # a sample of short lists repeats some


def _grid(varies: Sequence[Vary]) -> list[tuple]:
    for vary in varies:
        if not vary.values and vary.ends:
            word = f"{vary.name}={value_text(vary.ends[0])}:{value_text(vary.ends[1])}"
            raise InputError(f"--vary {word} has no number of values: write {word}:9, or add --sample N")
    count = math.prod(len(vary.values) for vary in varies)
    if count > MOST_VARIATIONS:
        raise InputError(
            f"--vary: {count} variations are more than {MOST_VARIATIONS}; give fewer values, or --sample N"
        )
    return list(itertools.product(*(vary.values for vary in varies)))


def _sample(varies: Sequence[Vary], count: int, seed: int) -> list[tuple]:
    from scipy.stats import qmc  # half a second

    points = qmc.Halton(len(varies), seed=seed).random(count) if varies else np.zeros((count, 0))
    return [tuple(vary.at(float(x)) for vary, x in zip(varies, point, strict=True)) for point in points]
