"""`--seek`: the search for the variation with the largest score, each evaluation a stored variation."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from pdvol.errors import SimulationError
from pdvol.studio.variations.jobs import Executor, Outcome
from pdvol.studio.variations.variation import Variation
from pdvol.studio.variations.vary import stored_value
from pdvol.studio.wedge.search import seek
from pdvol.studio.wedge.wedge import Wedge

BATCH = 6  # variations of a generation at least: what CMA-ES takes in two parameters
LEAST_SECONDS = 1e-3  # of a search whose time was up before it began


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
        wedge.best = _best(wedge, text, numbers) or wedge.best
        return [math.nan if score is None else score for score in scores]

    batch = executor.count * math.ceil(BATCH / executor.count)
    seek(evaluate, ranges, runs, max(deadline - time.monotonic(), LEAST_SECONDS), seed, goal=goal, batch=batch)
    best = _best(wedge, text, numbers)
    if best is None:
        reason = next((wedge.entries[n]["reason"] for n in numbers if wedge.entries[n]["reason"]), "")
        raise SimulationError(f"--seek {text}: no run has a score" + (f"; {reason}" if reason else ""))
    wedge.best = best
    return best


def _best(wedge: Wedge, text: str, numbers: Sequence[int]) -> dict[str, Any] | None:
    scored = [(score, -n) for n in numbers if (score := wedge.entries[n]["scores"].get(text)) is not None]
    if not scored:
        return None
    score, number = max(scored)
    return {"number": -number, "score": score, "of": text, "runs": len(set(numbers))}
