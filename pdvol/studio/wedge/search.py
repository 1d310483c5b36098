"""`--seek`: the search for the variation with the largest score, by CMA-ES (Hansen 2016, arXiv:1604.00772; library
`cma`).

The strategy asks for a batch of variations, which run side by side and are stored, and is given their ranks.
"""

import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.studio.variations.jobs import Executor, Outcome
from pdvol.studio.variations.variation import Variation
from pdvol.studio.variations.vary import stored_value
from pdvol.studio.wedge.wedge import Wedge

BATCH = 6  # variations of a generation at least: what CMA-ES takes in two parameters
LEAST_SECONDS = 1e-3  # of a search whose time was up before it began
FIRST_SPREAD = 0.3  # standard deviation of the first batch, in ranges: it covers them
MOST_RESTARTS = 50  # of a strategy that has contracted to a point, in one search

Evaluate = Callable[[list[dict[str, float]]], list[float]]


def seek_best(
    wedge: Wedge,
    text: str,
    ranges: Mapping[str, tuple[float, float]],
    executor: Executor,
    runs: int,
    deadline: float,
    seed: int,
    report: Callable[[dict[str, Any], Outcome], None],
    goal: float | None = None,
) -> dict[str, Any]:
    """Search ranges of parameters for the largest score; wedge.json gets the result as `best`.

    Variations that are stored are not run again: the same search goes on where it was interrupted.

    Parameters
    ----------
    text : of the score, one of the wedge's
    runs : evaluations at most
    deadline : on `time.monotonic()`'s clock [s]
    report : called with the entry and the outcome of each run that ended
    goal : a score with which the search ends

    Returns
    -------
    dict
        `number` of the variation, `score`, `of` (the text), `runs` (evaluations).

    Raises
    ------
    SimulationError
        No run has a score.
    """
    numbers: list[int] = []

    def evaluate(points: Sequence[Mapping[str, float]]) -> list[float]:
        tried = [Variation.of({name: stored_value(float(x)) for name, x in point.items()}) for point in points]
        found = wedge.add(tried, [f"{name}={low:g}:{high:g}" for name, (low, high) in ranges.items()])
        numbers.extend(found)
        wedge.run(found, executor, report, deadline)
        scores = [wedge.entries[number]["scores"].get(text) for number in found]
        return [math.nan if score is None else score for score in scores]

    batch = executor.count * math.ceil(BATCH / executor.count)
    seconds = max(deadline - time.monotonic(), LEAST_SECONDS)
    best: dict[str, Any] | None = None
    for found in seek(evaluate, ranges, runs, seconds, seed, goal, batch):
        if found.number >= 0:
            best = {"number": numbers[found.number], "score": found.score, "of": text, "runs": len(set(numbers))}
            wedge.best = best
    if best is None:
        reason = next((wedge.entries[n]["reason"] for n in numbers if wedge.entries[n]["reason"]), "")
        raise SimulationError(f"--seek {text}: no run has a score" + (f"; {reason}" if reason else ""))
    return best


@dataclass(frozen=True)
class Found:
    """What a search has found.

    Attributes
    ----------
    number : of the best variation, counted from 0 in the order of evaluation; -1 where every evaluation failed
    score : of the best variation; NaN where every evaluation failed
    runs : how many variations were evaluated
    """

    number: int
    score: float
    runs: int


def seek(
    evaluate: Evaluate,
    ranges: Mapping[str, tuple[float, float]],
    runs: int,
    seconds: float,
    seed: int,
    goal: float | None = None,
    batch: int | None = None,
) -> Iterator[Found]:
    """Look for the parameters with the highest score; yields what is found so far after each batch. Same seed and same
    scores, same search.

    Parameters
    ----------
    evaluate : gives the scores of a batch of variations, one each; NaN for those that failed, which count as the worst
    ranges : lower and upper bound of each parameter; nothing outside is evaluated
    runs : the most variations that are evaluated
    seconds : no batch is begun later [s]
    seed : of the random numbers, 0 or above
    goal : the search ends with the batch in which a score reaches it
    batch : variations per batch, at least 4; a multiple of the number of workers keeps them busy

    Raises
    ------
    InputError
        A range is empty or not finite, or a bound is not positive.
    """
    low, high = _bounds(ranges)
    if runs < 1 or not seconds > 0.0 or seed < 0:
        raise InputError(f"a search needs runs = {runs}, seconds = {seconds:g} above 0 and seed = {seed} not below 0")
    begin, names = time.monotonic(), list(ranges)
    size = max(4, 4 + int(3 * np.log(len(names))) if batch is None else batch)
    found = Found(-1, math.nan, 0)
    for restart in range(MOST_RESTARTS):
        strategy = _strategy(len(names), size, seed + 7919 * restart, anywhere=restart > 0)
        while not strategy.stop():
            proposed = strategy.ask()
            variations = [_named(names, low, high, point) for point in proposed[: runs - found.runs]]
            scores = [float(score) for score in evaluate(variations)]
            if len(scores) != len(variations):
                raise InputError(f"{len(variations)} variations were to be scored, {len(scores)} scores came back")
            for score in scores:
                better = not math.isnan(score) and not score <= found.score
                number, best = (found.runs, score) if better else (found.number, found.score)
                found = Found(number, best, found.runs + 1)
            yield found
            reached = goal is not None and found.score >= goal
            if reached or found.runs >= runs or time.monotonic() - begin >= seconds:
                return
            strategy.tell(proposed, losses(scores))


def losses(scores: Sequence[float]) -> list[float]:
    """What a strategy makes small: minus the scores; all that failed share a value above that of any other."""
    values = [-score for score in scores]
    finite = np.array([value for value in values if np.isfinite(value)])
    worst = (float(finite.max()) + max(1.0, float(np.ptp(finite)))) if len(finite) else 0.0
    least = (float(finite.min()) - 1.0) if len(finite) else -1.0
    return [least if value == -np.inf else value if np.isfinite(value) else worst for value in values]


def _bounds(ranges: Mapping[str, tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    if not ranges:
        raise InputError("a search needs parameters to vary: --vary name=lower:upper")
    for name, (lower, upper) in ranges.items():
        if not (np.isfinite(lower) and np.isfinite(upper) and lower < upper):
            raise InputError(f"a search varies {name} from {lower:g} to {upper:g}: write a lower and a higher number")
    low, high = np.array(list(ranges.values()), dtype=float).T
    return low, high


def _named(names: Sequence[str], low: np.ndarray, high: np.ndarray, point: np.ndarray) -> dict[str, float]:
    values = np.clip(low + np.asarray(point)[: len(names)] * (high - low), low, high)
    return dict(zip(names, values.tolist(), strict=True))


def _strategy(count: int, size: int, seed: int, anywhere: bool) -> Any:
    """CMA-ES in the unit cube, from its middle, or from a random place."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cma warns at import where matplotlib's pyplot is not wanted
        import cma
    dimensions = max(count, 2)  # cma takes no single parameter: one that nothing depends on is added
    start = np.random.default_rng(seed).uniform(0.2, 0.8, dimensions) if anywhere else np.full(dimensions, 0.5)
    options = {"bounds": [0.0, 1.0], "seed": seed + 1, "popsize": size, "verbose": -9, "verb_log": 0}
    return cma.CMAEvolutionStrategy(start, FIRST_SPREAD, options)
