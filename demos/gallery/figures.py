"""The table of levels of a stored run."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.common.tables import number, table
from pdvol.measure.verify import LevelFindings, check_levels
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.variations.variation import length

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
    above, alone = (_motions(each) if each else {} for each in (run, direct))

    def row(name: str, cell: Callable[[RunLevel], str]) -> list[str]:
        return [name, *(cell(level) for level in levels)]

    def from_0(level: RunLevel, motions: Mapping[int, Mapping[str, Any]] = above) -> str:
        measured = motions.get(level.index, {})
        if "distance" not in measured:
            return ""
        return f"{length(measured['distance'])} ({length(measured['largest_distance'])})"

    rows = [
        row("vertices, cells", lambda level: f"{len(level.rest):,}, {len(level.cells):,}"),
        row("CPU seconds a step", lambda level: number(float(np.mean([r["seconds"]["cpu"] for r in level.log])), 2)),
        row("Newton iterations (most)", lambda level: _spread([r["newton_iterations"] for r in level.log])),
        row("from level 0 (largest)", from_0),
        *([row("`--method direct` (largest)", lambda level: from_0(level, alone))] if direct else []),
    ]
    crossings = "; ".join(dict.fromkeys(_crossings(found[level.index]) for level in levels))
    head = ["", *(f"level {level.index}" for level in levels)]
    return f"{table(head, rows)}\n\nIntersections on each level: {crossings}."


def _motions(run: Run) -> dict[int, dict[str, Any]]:
    return {entry["level"]: entry for entry in motion_from_level_0(run)}


def _spread(values: Sequence[float]) -> str:
    return f"{number(float(np.mean(values)), 2)} ({number(float(max(values)), 2)})"


def _crossings(found: LevelFindings) -> str:
    """By the check that is independent of the solver; planes and inverted cells are problems as well."""
    others = len(found.problems)
    return f"{found.crossings} in {found.steps} states" + (f"; {others} problems" if others else "")
