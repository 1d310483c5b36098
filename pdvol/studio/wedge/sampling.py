"""Which variations a wedge has: the grid of `--vary`, `--sample` and `--jitter`."""

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from scipy.stats import qmc

from pdvol.errors import InputError
from pdvol.studio.variations.variation import Variation
from pdvol.studio.variations.vary import MOST_VARIATIONS, Vary

TAKEN = {"steps": "--steps", "jitter": "--jitter"}
"""Settings that are given in another way."""


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
    points = qmc.Halton(len(varies), seed=seed).random(count)
    return [
        {vary.name: vary.at(float(fraction)) for vary, fraction in zip(varies, point, strict=True)} for point in points
    ]


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
