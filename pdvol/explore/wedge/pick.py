"""One variation of a wedge, taken out as a run of its own and refined; and how near its finer levels stay."""

import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.explore.wedge.wedge import Score, read_wedge
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.store.files import TEMPORARY
from pdvol.store.folder import holds_run
from pdvol.store.reader import Run, open_run


def chosen_run(folder: Path, number: int) -> tuple[Path, dict[str, Any]]:
    """The run folder of a variation, and its entry in wedge.json.

    Raises
    ------
    InputError
        There is no such wedge or number, or its run is not done.
    """
    entries = read_wedge(folder)["variations"]
    entry = next((entry for entry in entries if entry.get("number") == number), None)
    if entry is None:
        raise InputError(f"{folder} has no variation {number}; it has 0 to {len(entries) - 1}")
    run = folder / "runs" / entry["name"]
    if entry["state"] != "done" or not holds_run(run):
        raise InputError(f"variation {number} of {folder} is {entry['state']}: {entry['reason'] or 'it has no run'}")
    return run, entry


def take_out(source: Path, out: Path, same: Callable[[Run], bool] | None = None) -> Path:
    """Copy a run folder, unless `out` holds that run already: then it is gone on with.

    Raises
    ------
    InputError
        `out` holds something else, or cannot be written.
    """
    stored = open_run(source)
    if holds_run(out):
        there = open_run(out)
        for key in ("description", "dt", "steps", "parameters"):
            if there.info.get(key) != stored.info.get(key):
                raise InputError(f"{out} holds another run; choose another folder by -o")
        return out
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError(f"{out} is not empty and holds no run; choose another folder by -o")
    aside = out.with_name(f".{out.name}{TEMPORARY}")
    try:
        shutil.rmtree(aside, ignore_errors=True)
        out.parent.mkdir(parents=True, exist_ok=True)
        shutil.copytree(source, aside, ignore=shutil.ignore_patterns("run.lock", f"*{TEMPORARY}"))
        os.replace(aside, out)
    except OSError as error:
        raise InputError(f"{out} cannot be written: {error.strerror or error}") from error
    return out


def level_view(run: Run, level: int) -> Run:
    """The run as if this level was its only one: scores look at level 0."""
    view = open_run(run.path)
    view.levels = (view.levels[level],)
    return view


def compared_levels(path: Path, scores: Mapping[str, Score]) -> list[dict[str, Any]]:
    """How far each level of a run is from level 0, which was chosen, and its scores.

    Returns
    -------
    list of dict
        For each level with all its states: as `motion_from_level_0`, and `scores`.
    """
    run = open_run(path)
    return [
        {**entry, "scores": {text: float(score(level_view(run, entry["level"]))) for text, score in scores.items()}}
        for entry in motion_from_level_0(run)
    ]


def level_line(entry: Mapping[str, Any], chosen: Mapping[str, Any], unit: Callable[[float], str]) -> str:
    """A level in one line: distances from what was chosen, and whether each score holds."""
    line = f"level {entry['level']} ({entry['vertices']} vertices)"
    if entry["level"]:
        line += (
            f": {unit(entry['distance'])} from level 0 at the end (largest over time {unit(entry['largest_distance'])}),"
            f" {entry['body']}'s centre {unit(entry['centre_drift'])} and {entry['angle_drift']:.2g} degrees"
        )
    else:
        line += ": as chosen"
    for text, score in entry["scores"].items():
        line += f"; {text} {score:.4g}"
        if entry["level"]:
            line += f" ({holds(score, chosen['scores'][text])})"
    return line
