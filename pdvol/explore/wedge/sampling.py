"""Which variations a wedge has: `--vary`, `--sample` and `--jitter`."""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import qmc

from pdvol.errors import InputError
from pdvol.explore.variation import Variation, value_text
from pdvol.runs.scene_file import parse_value

MOST_VARIATIONS = 10_000  # runs that one folder can list and one command line can start
NEARLY_ZERO = 1e-9  # of a range's larger end: rounding of a value that is meant to be zero
TAKEN = {"steps": "--steps", "jitter": "--jitter"}
"""Settings that are given in another way."""


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

    def at(self, share: float) -> Any:
        """The value at a share in [0, 1) of the range, or of the list."""
        if self.ends is None:
            return self.values[int(share * len(self.values))]
        return between(self.ends, share)


def between(ends: tuple[float, float], share: float) -> Any:
    """The value at a share of a range, as it is written on a command line."""
    value = ends[0] + share * (ends[1] - ends[0])
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
    if name in TAKEN:
        raise InputError(f"--vary {word}: give {name} by {TAKEN[name]}")
    parts = text.split(":")
    numbers = [_number(part) for part in parts]
    if len(parts) in (2, 3) and None not in numbers[:2]:
        ends = float(numbers[0] or 0.0), float(numbers[1] or 0.0)
        if not all(math.isfinite(end) for end in ends):
            raise InputError(f"--vary {word}: the ends of a range are finite numbers")
        if len(parts) == 2:
            return Vary(name, (), ends)
        if not parts[2].strip().isdigit() or not 2 <= int(parts[2]) <= MOST_VARIATIONS:
            raise InputError(f"--vary {word}: N in A:B:N is a whole number from 2 to {MOST_VARIATIONS}")
        return Vary(name, tuple(between(ends, share) for share in np.linspace(0.0, 1.0, int(parts[2]))), ends)
    values = tuple(parse_value(part) for part in _split(text))
    if any(value == "" for value in values):
        raise InputError(f"--vary {word}: a value is empty")
    return Vary(name, values)


def _split(text: str) -> list[str]:
    """At commas that are in no brackets: a value may be a vector."""
    return [part.strip() for part in re.split(r",(?![^(\[]*[)\]])", text)]


def _number(text: str) -> float | None:
    value = parse_value(text.strip())
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def parsed_varies(words: Sequence[str]) -> list[Vary]:
    """All `--vary` of a command line; InputError where one is wrong or a name comes twice."""
    varies = [parse_vary(word) for word in words]
    for vary in varies:
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
    if sample is None:
        found = _grid(varies, jitter is not None)
    else:
        if not varies and jitter is None:
            raise InputError("--sample needs --vary NAME=A:B or --jitter: nothing would differ")
        found = _sample(varies, sample, seed)
    if jitter is not None:
        found = [{**changes, "jitter": (jitter, number)} for number, changes in enumerate(found)]
    return list(dict.fromkeys(Variation.of(changes) for changes in found))  # a sample of short lists repeats some


def _grid(varies: Sequence[Vary], jitter: bool) -> list[dict[str, Any]]:
    if not varies:
        raise InputError("say what differs: --vary NAME=A:B:N" + (", or how many: --sample N" if jitter else ""))
    for vary in varies:
        if not vary.values:
            ends = vary.ends or (0.0, 0.0)
            raise InputError(
                f"--vary {vary.name}={ends[0]:g}:{ends[1]:g} has no number of values: write"
                f" {vary.name}={ends[0]:g}:{ends[1]:g}:9, or add --sample N"
            )
    count = math.prod(len(vary.values) for vary in varies)
    if count > MOST_VARIATIONS:
        raise InputError(
            f"--vary: {count} variations are more than {MOST_VARIATIONS}; give fewer values, or --sample N"
        )
    return [
        {vary.name: value for vary, value in zip(varies, values, strict=True)}
        for values in itertools.product(*(vary.values for vary in varies))
    ]


def _sample(varies: Sequence[Vary], count: int, seed: int) -> list[dict[str, Any]]:
    if not varies:
        return [{} for _ in range(count)]
    shares = qmc.Halton(len(varies), seed=seed).random(count)
    return [{vary.name: vary.at(float(share)) for vary, share in zip(varies, row, strict=True)} for row in shares]


def search_ranges(varies: Sequence[Vary]) -> Mapping[str, tuple[float, float]]:
    """The ranges of `--seek`; InputError where a `--vary` is a list, or there is none."""
    if not varies:
        raise InputError("--seek needs ranges: --vary NAME=A:B")
    found = {}
    for vary in varies:
        if vary.ends is None or vary.ends[0] == vary.ends[1]:
            raise InputError(f"--seek needs ranges: write --vary {vary.name}=A:B")
        found[vary.name] = (min(vary.ends), max(vary.ends))
    return found
