"""One variation of a wedge, taken out as a run and refined; and how near its finer levels stay."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.runs.run_metrics import motion_from_level_0
from pdvol.store.copying import copy_run, require_new
from pdvol.store.folder import holds_run
from pdvol.store.reader import open_run
from pdvol.studio.shown import wedge_run
from pdvol.studio.wedge.scored_body import at_level
from pdvol.studio.wedge.scores import Score
from pdvol.studio.wedge.variation import length
from pdvol.studio.wedge.wedge import read_wedge

LOSS = 0.1  # of a score: a level that loses less still does what was chosen


def chosen_run(folder: Path, which: str) -> tuple[Path, dict[str, Any]]:
    """The run folder of a variation, by its number or as the `best` of a search, and its entry in wedge.json.

    Raises
    ------
    InputError
        There is no such wedge or number, nothing was searched, or its run is not done.
    """
    wedge = read_wedge(folder)
    entries, best = wedge["variations"], wedge.get("best")
    if which == "best" and not isinstance(best, dict):
        raise InputError(f"{folder} holds no search; name a number, or use pdvol wedge --seek")
    if which != "best" and not which.isdecimal():
        raise InputError(f"{which!r} is not the number of a variation; give one, or best")
    number = best.get("number") if isinstance(best, dict) and which == "best" else int(which)
    entry = next((entry for entry in entries if entry.get("number") == number), None)
    if entry is None:
        raise InputError(f"{folder} has no variation {number}; it has 0 to {len(entries) - 1}")
    run = wedge_run(folder, entry["number"], entry["name"])
    if entry["state"] != "done" or not holds_run(run):
        raise InputError(f"variation {number} of {folder} is {entry['state']}: {entry['reason'] or 'it has no run'}")
    return run, entry


def take_out(source: Path, out: Path) -> None:
    """Copy a run folder, unless `out` holds that run already: then it is gone on with.

    Raises
    ------
    InputError
        `out` holds something else.
    SimulationError
        It cannot be written.
    """
    if not holds_run(out):
        require_new(out)
        copy_run(source, out)
        return
    stored, there = open_run(source), open_run(out)
    if any(there.info.get(key) != stored.info.get(key) for key in ("description", "dt", "steps", "parameters")):
        raise InputError(f"{out} holds another run; choose another folder by -o")


def level_lines(path: Path, scores: Mapping[str, Score]) -> Iterator[str]:
    """A line for each finished level of a run: how far it is from level 0, which was chosen, and whether each score
    holds.

    Parameters
    ----------
    scores : those of the wedge, by their texts
    """
    run = open_run(path)
    first: dict[str, float] = {}
    for level in motion_from_level_0(run):
        index, parts = level["level"], ["as chosen"]
        if index:
            parts = [
                f"ends {length(level['distance'])} from level 0 (largest over time {length(level['largest_distance'])})"
                f", {level['body']} {length(level['centre_drift'])} and {level['angle_drift']:.2g} degrees"
            ]
        for text, score in scores.items():
            value = float(score(at_level(run, index)))
            parts.append(f"{text} {value:.4g}")
            if index:
                parts[-1] += " holds" if holds(value, first[text]) else " does not hold"
            first.setdefault(text, value)
        yield f"level {index}, {level['vertices']:,} vertices: {'; '.join(parts)}"


def holds(score: float, chosen: float) -> bool:
    """Whether a finer level's score is as good as the chosen one, but for `LOSS` of its size."""
    return score >= chosen - LOSS * max(abs(chosen), LOSS)
