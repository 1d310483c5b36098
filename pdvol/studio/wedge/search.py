"""The search for parameters with a high score: CMA-ES (Hansen 2016, arXiv:1604.00772), by the library `cma`.

The strategy asks for a batch of variations, which run side by side, and is given their ranks.
"""

import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.errors import InputError

FIRST_SPREAD = 0.3  # standard deviation of the first batch, in ranges: it covers them
MOST_RESTARTS = 50  # of a strategy that has contracted to a point, in one search

Evaluate = Callable[[list[dict[str, float]]], list[float]]


@dataclass(frozen=True)
class Found:
    """What a search found.

    Attributes
    ----------
    parameters : of the best variation; empty where every evaluation failed
    score : of the best variation; NaN where every evaluation failed
    number : of the best variation, counted from 0 in the order of evaluation; -1 where every evaluation failed
    runs : how many variations were evaluated
    seconds : that the search took [s]
    history : the best score so far after each evaluation, NaN before the first one that did not fail
    ended : why the search ended: "goal", "runs", "seconds" or "still" (no parameter could be varied any more)
    """

    parameters: dict[str, float]
    score: float
    number: int
    runs: int
    seconds: float
    history: tuple[float, ...]
    ended: str


def seek(
    evaluate: Evaluate,
    ranges: Mapping[str, tuple[float, float]],
    runs: int,
    seconds: float,
    seed: int,
    report: Callable[[Found], object] | None = None,
    goal: float | None = None,
    batch: int | None = None,
) -> Found:
    """Look for the parameters with the highest score. Same seed and same scores, same search.

    Parameters
    ----------
    evaluate : gives the scores of a batch of variations, one each; NaN for those that failed, which count as the worst
    ranges : lower and upper bound of each parameter; nothing outside is evaluated
    runs : the most variations that are evaluated
    seconds : no batch is begun later [s]
    seed : of the random numbers, 0 or above
    report : called with what is found so far after each batch
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
    best, spent = Found({}, np.nan, -1, 0, 0.0, (), ""), 0.0
    history: list[float] = []
    for restart in range(MOST_RESTARTS):
        strategy = _strategy(len(names), size, seed + 7919 * restart, anywhere=restart > 0)
        while not strategy.stop():
            proposed = strategy.ask()
            now = proposed[: runs - len(history)]
            variations = [_named(names, low, high, point) for point in now]
            scores = [float(score) for score in evaluate(variations)]
            if len(scores) != len(variations):
                raise InputError(f"{len(variations)} variations were to be scored, {len(scores)} scores came back")
            for parameters, score in zip(variations, scores, strict=True):
                if not np.isnan(score) and not score <= best.score:
                    best = Found(parameters, score, len(history), 0, 0.0, (), "")
                history.append(best.score)
            spent = time.monotonic() - begin
            reached = goal is not None and best.score >= goal
            ended = "goal" if reached else "runs" if len(history) >= runs else "seconds" if spent >= seconds else ""
            found = Found(best.parameters, best.score, best.number, len(history), spent, tuple(history), ended)
            if report is not None:
                report(found)
            if ended:
                return found
            strategy.tell(proposed, losses(scores))
    return Found(best.parameters, best.score, best.number, len(history), spent, tuple(history), "still")


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
