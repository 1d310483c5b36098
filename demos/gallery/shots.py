"""What a level costs, of all shots: figures kept beside each page as NAME.json, and the table that is made of them."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.common.tables import number, table
from demos.gallery.entries import Entry
from pdvol.store.files import read_json, write_json
from pdvol.store.reader import Run, RunLevel

SAVING = 10.0
"""Ratio of times, without a unit: the order of magnitude that a preview is to save at least."""
MADE = re.compile(r"at commit ([0-9a-f, ]+?)(?: \(by the direct method: ([0-9a-f, ]+)\))? on one core of ([^.]+)\.")
"""What a page says on its runs: commits, those by the direct method where they are others, and the machine."""


def costs(run: Run) -> list[dict[str, Any]]:
    """Of each level with steps: `level`, `vertices`, `cells`, `steps`, `cpu` [s] and `newton` (iterations), both means
    over the steps, and `contacts`, the most in a step.
    """
    return [_cost(level) for level in run.levels if level.steps > 1]


def _cost(level: RunLevel) -> dict[str, Any]:
    return {
        "level": level.index,
        "vertices": len(level.rest),
        "cells": len(level.cells),
        "steps": level.steps - 1,
        "cpu": float(np.mean([record["seconds"]["cpu"] for record in level.log])),
        "newton": float(np.mean([record["newton_iterations"] for record in level.log])),
        "contacts": max(record["contacts"] for record in level.log),
    }


def write_costs(
    run: Run, direct: Run | None, made: Mapping[str, Any], made_directly: Mapping[str, Any], out: Path
) -> Path:
    """Keep what a page's runs cost: `made` and `made_directly` as `simulation.note` gives them, `levels` and `direct`
    as `costs`; `direct` is empty without a run by the direct method.
    """
    found = {
        "made": dict(made),
        "levels": costs(run),
        "made_directly": dict(made_directly),
        "direct": costs(direct) if direct else [],
    }
    write_json(out, found)
    return out


def read_costs(page: Path, name: str = "") -> dict[str, Any]:
    """What the runs of a page cost: what is kept beside it, where that is of the same run, or what its own table says.

    Parameters
    ----------
    name : of the run, where it is a variant's: nothing but what is kept counts then

    Returns
    -------
    dict
        `commits`, `direct_commits` and `machine` as on the page, `levels` and `direct` as in `write_costs`; no levels
        where nothing is known of a variant.
    """
    text, variant = page.read_text(encoding="utf-8"), name not in ("", page.stem)
    commits, directly, machine = (MADE.findall(text) or [("", "", "")])[0]
    found = {"commits": commits, "direct_commits": directly or commits, "machine": machine, "direct": []}
    beside = page.with_name(f"{name or page.stem}.json")
    kept = read_json(beside) if beside.is_file() else {}
    if kept and (variant or _short(kept["made"]) == commits):
        own = {"commits": _short(kept["made"]), "direct_commits": _short(kept["made_directly"])}
        return found | own | {"levels": kept["levels"], "direct": kept["direct"]}
    return found | {"levels": [] if variant else _levels_on(text)}


def _short(made: Mapping[str, Any]) -> str:
    return ", ".join(commit[:7] for commit in made.get("commits", ()) if commit)


def _levels_on(text: str) -> list[dict[str, Any]]:
    """The levels by the first table of a page."""
    rows = {cells[0]: cells[1:] for line in text.splitlines() if (cells := _cells(line))}
    first = lambda cell: float(re.split(r"[ ,]", cell.replace(",", ""))[0])
    found = []
    for k, sizes in enumerate(rows["vertices, cells"]):
        vertices, cells = (int(size.replace(",", "")) for size in sizes.split(", "))
        found.append(
            {
                "level": k,
                "vertices": vertices,
                "cells": cells,
                "cpu": first(rows["CPU seconds a step, mean (most)"][k]),
                "newton": first(rows["Newton iterations a step, mean (most)"][k]),
                "contacts": int(rows["most contacts"][k].replace(",", "")),
            }
        )
    return found


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.split("|")[1:-1]] if line.startswith("| ") else []


HEAD = [
    "shot",
    "figure of the paper",
    "vertices: level 0, finest",
    "CPU seconds a step: level 0, finest",
    "times as long",
    "Newton iterations a step: level 0, finest",
    "finest level by `--method direct`: seconds, iterations",
    "commit",
]


def table_of_shots(entries: Sequence[Entry], pages: Path) -> str:
    """Markdown: a row for each shot whose page is there, those of the paper first, and a sentence on what they save."""
    there = [entry for entry in entries if (pages / f"{entry.name}.md").is_file()]
    rows, ratios, little, beside = [], [], [], []
    for entry in sorted(there, key=lambda entry: not entry.paper):
        for each in (entry, *(entry.varied(variant) for variant in entry.variants)):
            found = read_costs(pages / f"{entry.name}.md", each.name)
            if not found["levels"]:
                continue
            ratios.append(found["levels"][-1]["cpu"] / found["levels"][0]["cpu"])
            beside += [found["levels"][-1]["cpu"] / level["cpu"] for level in _direct(found)]
            rows.append(_row(each, f"{entry.name}.md", found, ratios[-1]))
            if ratios[-1] < SAVING:
                little.append((each, ratios[-1]))
    text = table(HEAD, rows)
    if len(rows) > len(little):
        text += (
            f"\n\nIn {len(rows) - len(little)} of {len(rows)} rows the finest level takes {SAVING:.0f} times as long as"
            f" level 0 or longer, up to {number(max(ratios), 2)} times."
        )
    if beside:
        text += (
            f" On {len(beside)} rows with a direct run, the refined finest level takes"
            f" {number(min(beside), 2)} to {number(max(beside), 2)} times its time, in the median"
            f" {number(float(np.median(beside)), 2)}."
        )
    for sort, of_paper in (("Of the paper's shots", True), ("Of the others", False)):
        named = [f"{each.title} ({number(ratio, 2)})" for each, ratio in little if bool(each.paper) == of_paper]
        if named:
            text += f" {sort} these have less to save: {', '.join(named)}."
    return text


def _row(entry: Entry, page: str, found: Mapping[str, Any], ratio: float) -> list[str]:
    coarse, fine = found["levels"][0], found["levels"][-1]
    direct = _direct(found)
    commit = found["commits"]
    if direct and found["direct_commits"] != commit:
        commit += f" (direct: {found['direct_commits']})"
    return [
        f"[{entry.title}]({page})",
        entry.paper,
        f"{coarse['vertices']:,}, {fine['vertices']:,}",
        f"{number(coarse['cpu'], 2)}, {number(fine['cpu'], 2)}",
        number(ratio, 2),
        f"{number(coarse['newton'], 2)}, {number(fine['newton'], 2)}",
        *([f"{number(level['cpu'], 2)}, {number(level['newton'], 2)}" for level in direct] or [""]),
        commit,
    ]


def _direct(found: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The direct run's finest level, if there is such a run of it."""
    return [level for level in found["direct"] if level["level"] == found["levels"][-1]["level"]]
