"""`--seek`: the search for the variation with the largest score, by CMA-ES (Hansen 2016, arXiv:1604.00772; library
`cma`).

The strategy asks for a batch of variations, which run side by side and are stored, and is given their ranks.
"""

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.studio.wedge.variation import Variation, value_text
from pdvol.studio.wedge.vary import Vary
from pdvol.studio.wedge.wedge import Report, Wedge
from pdvol.studio.workers import Workers

BATCH = 6  # variations of a generation at least: what CMA-ES takes in two parameters
FIRST_SPREAD = 0.3  # standard deviation of the first batch, in ranges: it covers them
MOST_RESTARTS = 50  # of a strategy that has contracted to a point, in one search


@dataclass(frozen=True)
class Until:
    """When a search ends.

    Attributes
    ----------
    runs : evaluations at most
    deadline : on `time.monotonic()`'s clock [s]: what runs then is stopped, and no batch is begun later
    goal : a score that is enough
    """

    runs: int
    deadline: float
    goal: float = math.inf


def seek_best(
    wedge: Wedge, text: str, varies: Sequence[Vary], workers: Workers, until: Until, seed: int, report: Report
) -> dict[str, Any]:
    """Search ranges of parameters for the largest score; wedge.json gets the result as `best`.

    Variations that are stored are not run again: the same search goes on where it was interrupted.

    Parameters
    ----------
    text : of the score, one of the wedge's
    varies : the ranges
    seed : of the random numbers, 0 or above
    report : called with the entry and the outcome of each run that ended

    Returns
    -------
    dict
        `number` of the variation, `score`, `of` (the text), `runs` (evaluations).

    Raises
    ------
    InputError
        A parameter has no range, or `cma` is not installed.
    SimulationError
        No run has a score.
    """
    if not varies:
        raise InputError("--seek needs ranges: --vary NAME=A:B")
    for vary in varies:
        if vary.ends is None or vary.ends[0] == vary.ends[1]:
            raise InputError(f"--seek needs ranges: write --vary {vary.name}=A:B")
    words = [f"{vary.name}={value_text(vary.ends[0])}:{value_text(vary.ends[1])}" for vary in varies if vary.ends]
    tried: list[dict[str, Any]] = []

    def evaluate(points: Sequence[np.ndarray]) -> list[float]:
        chosen = [{vary.name: vary.at(float(x)) for vary, x in zip(varies, point, strict=True)} for point in points]
        numbers = wedge.add([Variation.of(changes) for changes in chosen], words)
        wedge.run(numbers, workers, report, until.deadline)
        tried.extend(wedge.entries[number] for number in numbers)
        scored = [entry for entry in tried if entry["scores"].get(text) is not None]
        if scored:
            best, count = max(scored, key=lambda entry: entry["scores"][text]), len({e["number"] for e in tried})
            wedge.best = {"number": best["number"], "score": best["scores"][text], "of": text, "runs": count}
        scores = [wedge.entries[number]["scores"].get(text) for number in numbers]
        return [math.nan if score is None else score for score in scores]

    seek(evaluate, len(varies), until, seed, workers.count * math.ceil(BATCH / workers.count))
    if wedge.best is None or all(entry["scores"].get(text) is None for entry in tried):
        reason = next((entry["reason"] for entry in tried if entry["reason"]), "")
        raise SimulationError(f"--seek {text}: no run has a score" + (f"; {reason}" if reason else ""))
    return wedge.best


def seek(
    evaluate: Callable[[Sequence[np.ndarray]], list[float]], count: int, until: Until, seed: int, batch: int = BATCH
) -> None:
    """Look for the point of the unit cube with the highest score. Same seed and same scores, same search.

    Parameters
    ----------
    evaluate : gives the scores of a batch of points (count,), one each; NaN for those that failed, which count as the
        worst
    batch : points at a time; a multiple of the number of workers keeps them busy
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # cma warns at import where matplotlib's pyplot is not wanted
            import cma
    except ModuleNotFoundError as error:
        raise InputError("--seek needs the package cma: pip install cma") from error
    dimensions = max(count, 2)  # cma takes no single parameter: one that nothing depends on is added
    done = 0
    for restart in range(MOST_RESTARTS):  # from the middle first, then from random places
        own = seed + 7919 * restart
        start = np.random.default_rng(own).uniform(0.2, 0.8, dimensions) if restart else np.full(dimensions, 0.5)
        options = {"bounds": [0.0, 1.0], "seed": own + 1, "popsize": batch, "verbose": -9, "verb_log": 0}
        strategy = cma.CMAEvolutionStrategy(start, FIRST_SPREAD, options)
        while not strategy.stop():
            proposed = strategy.ask()
            scores = evaluate([np.clip(point[:count], 0.0, 1.0) for point in proposed[: until.runs - done]])
            done += len(scores)
            if max(scores, key=_or_least) >= until.goal or done >= until.runs or time.monotonic() >= until.deadline:
                return
            strategy.tell(proposed, losses(scores))


def _or_least(score: float) -> float:
    return -math.inf if math.isnan(score) else score


def losses(scores: Sequence[float]) -> list[float]:
    """The values that a strategy makes small: minus the scores; all that failed share one above that of any other."""
    values = np.array([-_or_least(score) for score in scores])
    finite = values[np.isfinite(values)]
    worst = finite.max() + max(1.0, np.ptp(finite)) if len(finite) else 0.0
    least = finite.min() - 1.0 if len(finite) else -1.0
    return [float(x) for x in np.nan_to_num(values, posinf=worst, neginf=least)]
