"""The table of levels of a stored run."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.common.tables import number, table
from pdvol.measure.verify import LevelFindings, check_levels
from pdvol.runs.run_metrics import distances_from_below, motion_from_level_0
from pdvol.solve.report import PARTS
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
    below = distances_from_below(run)
    above, alone = (_motions(each) if each else {} for each in (run, direct))

    def row(name: str, cell: Callable[[RunLevel], str]) -> list[str]:
        return [name, *(cell(level) for level in levels)]

    def from_below(level: RunLevel) -> str:
        measured = below.get(level.index)
        return f"{length(float(np.mean(measured)))} ({length(max(measured))})" if measured else ""

    def from_0(level: RunLevel, motions: Mapping[int, Mapping[str, Any]] = above) -> str:
        measured = motions.get(level.index, {})
        if "distance" not in measured:
            return ""
        return f"{length(measured['distance'])} ({length(measured['largest_distance'])})"

    rows = [
        row("vertices, cells", lambda level: f"{len(level.rest):,}, {len(level.cells):,}"),
        row("CPU seconds a step (most)", lambda level: _spread([r["seconds"]["cpu"] for r in level.log])),
        row("parts [%]", _shares),
        row("Newton iterations (most)", lambda level: _spread([r["newton_iterations"] for r in level.log])),
        row("most contacts", lambda level: f"{max(r['contacts'] for r in level.log):,}"),
        row("from the level below (largest)", from_below),
        row("from level 0 (largest)", from_0),
        *([row("`--method direct` (largest)", lambda level: from_0(level, alone))] if direct else []),
        row("smallest gap", _smallest_gap),
        row("smallest det F", lambda level: number(found[level.index].smallest_det, 2)),
        row("intersections in states", lambda level: _crossings(found[level.index])),
    ]
    return table(["", *(f"level {level.index}" for level in levels)], rows)


def _motions(run: Run) -> dict[int, dict[str, Any]]:
    return {entry["level"]: entry for entry in motion_from_level_0(run)}


def _spread(values: Sequence[float]) -> str:
    return f"{number(float(np.mean(values)), 2)} ({number(float(max(values)), 2)})"


def _shares(level: RunLevel) -> str:
    """How a level's CPU time is divided; parts are measured in wall time, each step's are scaled to its CPU time."""
    seconds = [record["seconds"] for record in level.log if record["seconds"]["total"] > 0.0]
    spent = [sum(s[part] * s["cpu"] / s["total"] for s in seconds) for part in (*PARTS, "other")]
    return ", ".join(f"{100 * part / sum(spent):.0f}" for part in spent)


def _smallest_gap(level: RunLevel) -> str:
    """Of all steps, as the log has it: between surfaces and to planes."""
    gaps = [record["min_gap"] for record in level.log if record.get("min_gap") is not None]
    return length(min(gaps)) if gaps and math.isfinite(min(gaps)) else "-"


def _crossings(found: LevelFindings) -> str:
    """By the check that is independent of the solver; planes and inverted cells are problems as well."""
    others = len(found.problems)
    return f"{found.crossings} in {found.steps}" + (f"; {others} problems" if others else "")
