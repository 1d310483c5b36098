"""One variation of a wedge, taken out as a run of its own and refined; and how near its finer levels stay."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.store.copying import copy_run
from pdvol.store.folder import holds_run
from pdvol.store.reader import open_run
from pdvol.studio.variations.variation import length
from pdvol.studio.wedge.scored_body import at_level
from pdvol.studio.wedge.scores import Score
from pdvol.studio.wedge.wedge import read_wedge

LOSS = 0.1  # of a score: a level that loses less still does what was chosen


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


def picked_number(folder: Path, text: str) -> int:
    """A number, or the one of `best`.

    Raises
    ------
    InputError
        It is neither, or nothing was searched.
    """
    if text == "best":
        best = read_wedge(folder).get("best")
        if not best:
            raise InputError(f"{folder} holds no search; name a number, or use pdvol wedge --seek")
        return int(best["number"])
    if not text.isdigit():
        raise InputError(f"{text!r} is not the number of a variation; give one, or best")
    return int(text)


def take_out(source: Path, out: Path) -> Path:
    """Copy a run folder, unless `out` holds that run already: then it is gone on with.

    Raises
    ------
    InputError
        `out` holds something else.
    SimulationError
        It cannot be written.
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
    copy_run(source, out)
    return out


def compared_levels(path: Path, scores: Mapping[str, Score]) -> list[dict[str, Any]]:
    """How far each finished level of a run is from level 0, which was chosen: as `motion_from_level_0` gives it, and
    the `scores` of each.
    """
    run = open_run(path)
    return [
        {**entry, "scores": {text: float(score(at_level(run, entry["level"]))) for text, score in scores.items()}}
        for entry in motion_from_level_0(run)
    ]


def level_line(entry: Mapping[str, Any], chosen: Mapping[str, Any]) -> str:
    """A level in one line: how far it is from what was chosen, and whether each score holds."""
    line = f"level {entry['level']}, {entry['vertices']:,} vertices: "
    if not entry["level"]:
        line += "as chosen"
    else:
        line += (
            f"ends {length(entry['distance'])} from level 0 (largest over time {length(entry['largest_distance'])}), "
        )
        line += f"{entry['body']} {length(entry['centre_drift'])} and {entry['angle_drift']:.2g} degrees"
    for text, score in entry["scores"].items():
        line += f"; {text} {score:.4g}"
        if entry["level"]:
            line += " holds" if holds(score, chosen["scores"][text]) else " does not hold"
    return line


def holds(score: float, chosen: float) -> bool:
    """Whether a finer level's score is as good as the chosen one, but for `LOSS` of its size."""
    return score >= chosen - LOSS * max(abs(chosen), LOSS)
