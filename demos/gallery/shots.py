"""What levels cost and how far they are from level 0: the table of a page, figures kept beside it as NAME.json, and the
table that is made of these.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.tables import number, table
from demos.gallery.entries import Entry
from pdvol.measure.verify import check_levels
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.store.files import read_json, write_json
from pdvol.store.reader import Run
from pdvol.studio.wedge.variation import length

MOST_STATES = 700  # of a level, that are checked for intersections

SAVING = 10.0
"""Ratio of times, without a unit: the order of magnitude that a preview is to save at least."""
HEAD = [
    "shot",
    "vertices: level 0, finest",
    "CPU seconds a step: level 0, finest",
    "times as long",
    "finest level by `--method direct` [s]",
]


def costs(run: Run) -> list[dict[str, Any]]:
    """Of each level with steps: `level`, `vertices`, `cells`, `steps`, `cpu` [s] and `newton` (iterations), both means
    over the steps, `contacts`, the most in a step, and `motion`: after each quarter of the shot the centre of the
    vertices, and how far they are from it in the root mean square [m].
    """
    return [
        {
            "level": level.index,
            "vertices": len(level.rest),
            "cells": len(level.cells),
            "steps": level.steps - 1,
            "cpu": float(np.mean([record["seconds"]["cpu"] for record in level.log])),
            "newton": float(np.mean([record["newton_iterations"] for record in level.log])),
            "contacts": max(record["contacts"] for record in level.log),
            "motion": [_place(level.positions((level.steps - 1) * k // 4)) for k in range(1, 5)],
        }
        for level in run.levels
        if level.steps > 1
    ]


def _place(points: np.ndarray) -> list[float]:
    centre = points.mean(axis=0)
    return [*centre.tolist(), float(np.sqrt(((points - centre) ** 2).sum(axis=1).mean()))]


def table_of_levels(run: Run, direct: Run | None = None) -> str:
    """Markdown: a column a level. Stored states are checked, so this takes as long as `pdvol verify`; every second one
    of a run of more than `MOST_STATES`, every third of more than twice as many, and so on.

    Parameters
    ----------
    direct : the same scene with `--method direct`, which gives a row of its own
    """
    levels = costs(run)
    rows = [
        ["vertices", *(f"{level['vertices']:,}" for level in levels)],
        ["CPU seconds a step", *(number(level["cpu"], 2) for level in levels)],
        ["Newton iterations a step", *(number(level["newton"], 2) for level in levels)],
    ]
    for name, each in (("at most from level 0", run), ("by `--method direct`", direct)):
        if each is not None:
            far = {found["level"]: length(found["largest_distance"]) for found in motion_from_level_0(each)[1:]}
            rows.append([name, *(far.get(level["level"], "") for level in levels)])
    crossings = []
    for found in check_levels(run.path, -(-run.info["steps"] // MOST_STATES)):
        others = f"; {len(found.problems)} problems" if found.problems else ""  # planes and inverted cells as well
        crossings += [f"{found.crossings} in {found.steps} states{others}"] * (found.steps > 1)
    head = ["", *(f"level {level['level']}" for level in levels)]
    return f"{table(head, rows)}\n\nIntersections: {'; '.join(dict.fromkeys(crossings))}."


def write_costs(
    run: Run, direct: Run | None, made: Mapping[str, Any], made_directly: Mapping[str, Any], out: Path
) -> None:
    """Keep what a page's runs cost: `made` and `made_directly` as `simulation.note` gives them, `levels` and `direct`
    as `costs`; `direct` is empty without a run by the direct method.
    """
    directly = costs(direct) if direct else []
    write_json(
        out, {"made": dict(made), "levels": costs(run), "made_directly": dict(made_directly), "direct": directly}
    )


def read_costs(entry: Entry, pages: Path) -> dict[str, Any]:
    """What `write_costs` has kept; empty where nothing is known."""
    kept = pages / f"{entry.name}.json"
    return read_json(kept) if kept.is_file() else {}


def commits(made: Mapping[str, Any]) -> str:
    """The first seven digits of the commits of a run, as `simulation.note` has them."""
    return ", ".join(commit[:7] for commit in made.get("commits", ()) if commit)


def table_of_shots(entries: Sequence[Entry], pages: Path) -> str:
    """Markdown: a row for each run whose costs are kept, and what they save."""
    rows, ratios, beside = [], [], []
    for entry in entries:
        for each in entry.rows:
            if found := read_costs(each, pages):
                row, saved = _row(each, f"{entry.name}.md", found)
                rows.append(row)
                ratios.append(saved)
                beside += [found["levels"][-1]["cpu"] / level["cpu"] for level in _direct(found)]
    text = table(HEAD, rows)
    if ratios:
        much = sum(ratio >= SAVING for ratio in ratios)
        text += (
            f"\n\nIn {much} of {len(rows)} rows the finest level takes {SAVING:.0f} times as long as"
            f" level 0 or longer, up to {number(max(ratios), 2)} times."
        )
    if beside:
        text += (
            f" On {len(beside)} rows with a direct run, the refined finest level takes"
            f" {number(min(beside), 2)} to {number(max(beside), 2)} times its time, in the median"
            f" {number(float(np.median(beside)), 2)}."
        )
    return text


def _row(entry: Entry, page: str, found: Mapping[str, Any]) -> tuple[list[str], float]:
    """A row of the table, and how many times as long the finest level takes."""
    coarse, fine, direct = found["levels"][0], found["levels"][-1], _direct(found)
    ratio = fine["cpu"] / coarse["cpu"]
    cells = [
        f"[{entry.title}]({page})",
        f"{coarse['vertices']:,}, {fine['vertices']:,}",
        f"{number(coarse['cpu'], 2)}, {number(fine['cpu'], 2)}",
        number(ratio, 2),
        *([number(level["cpu"], 2) for level in direct] or [""]),
    ]
    return cells, ratio


def _direct(found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The direct run's finest level, if there is such a run of it."""
    return [level for level in found["direct"] if level["level"] == found["levels"][-1]["level"]]
