"""The table of levels of a stored run."""

from collections.abc import Callable, Sequence

import numpy as np

from benchmarks.common.tables import number, table
from pdvol.measure.verify import LevelFindings, check_levels
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.wedge.variation import length

MOST_STATES = 700  # of a level, that are checked for intersections


def table_of_levels(run: Run, direct: Run | None = None) -> str:
    """Markdown: a column a level. Stored states are checked, so this takes as long as `pdvol verify`; every second one
    of a run of more than `MOST_STATES`, every third of more than twice as many, and so on.

    Parameters
    ----------
    direct : the same scene with `--method direct`, which gives a row of its own
    """
    levels = [level for level in run.levels if level.steps > 1]
    every = -(-run.info["steps"] // MOST_STATES)
    found = {checked.index: checked for checked in check_levels(run.path, every)}
    above, alone = (_largest(each) if each else {} for each in (run, direct))

    def row(name: str, cell: Callable[[RunLevel], str]) -> list[str]:
        return [name, *(cell(level) for level in levels)]

    def mean(values: Sequence[float]) -> str:
        return number(float(np.mean(values)), 2)

    rows = [
        row("vertices", lambda level: f"{len(level.rest):,}"),
        row("CPU seconds a step", lambda level: mean([record["seconds"]["cpu"] for record in level.log])),
        row("Newton iterations a step", lambda level: mean([record["newton_iterations"] for record in level.log])),
        row("at most from level 0", lambda level: above.get(level.index, "")),
        *([row("by `--method direct`", lambda level: alone.get(level.index, ""))] if direct else []),
    ]
    crossings = "; ".join(dict.fromkeys(_crossings(found[level.index]) for level in levels))
    head = ["", *(f"level {level.index}" for level in levels)]
    return f"{table(head, rows)}\n\nIntersections: {crossings}."


def _largest(run: Run) -> dict[int, str]:
    """How far each level is from level 0, at most in any state."""
    return {entry["level"]: length(entry["largest_distance"]) for entry in motion_from_level_0(run)[1:]}


def _crossings(found: LevelFindings) -> str:
    """By the check that is independent of the solver; planes and inverted cells are problems as well."""
    others = len(found.problems)
    return f"{found.crossings} in {found.steps} states" + (f"; {others} problems" if others else "")
