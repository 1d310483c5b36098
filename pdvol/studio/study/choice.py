"""The settings that a study has found for a wanted accuracy or time."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdvol.errors import InputError
from pdvol.runs.scene_file import Shot, load_shot, parse_value
from pdvol.store.files import read_json, require_no_link_out
from pdvol.studio.study.front import cheapest_within, most_accurate_within
from pdvol.studio.study.study import STUDY_FORMAT
from pdvol.studio.wedge.variation import length

LENGTHS = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "%": None}
TIMES = {"s": 1.0, "min": 60.0, "h": 3600.0}


def chosen_point(folder: Path, shot: Shot, accuracy: str, time: str) -> dict:
    """The point of a study for an accuracy such as `5mm` or `1%`, or a time such as `10min`.

    Parameters
    ----------
    folder : of the study
    shot : what is to run; the study must be one of it
    accuracy, time : one of them is empty

    Raises
    ------
    InputError
        There is no such study, it is one of another scene, or it has no such point.
    """
    study = read_study(folder)
    if study["description"] != {"scene": shot.description(), "steps": shot.scene.steps, "method": study["method"]}:
        raise InputError(f"{folder} is a study of another scene or other settings; run: pdvol study {shot.file} -o DIR")
    if "reference" not in study or not study["points"]:
        raise InputError(f"{folder} has no reference yet; run pdvol study again with a larger --budget")
    points = [*study["points"], study["reference"]["point"]]
    if time:
        found = most_accurate_within(points, _amount("--time", time, TIMES))
        if found is None:
            least = min(point["cost"]["cpu"] for point in points)
            raise InputError(f"--time {time}: the cheapest settings in {folder} take {least:.3g} s")
        return dict(found)
    limit = _amount("--accuracy", accuracy, {**LENGTHS, "%": 0.01 * study["size"]})
    own = float("inf") if study["reference"]["error"] is None else study["reference"]["error"]
    found = cheapest_within(points, limit, own) or cheapest_within(points, limit, 0.0)
    if found is None:
        best = min(point["errors"]["end"] for point in points)
        raise InputError(
            f"--accuracy {accuracy}: the best settings in {folder} end {length(best)} from its reference; run pdvol"
            " study with a larger --budget"
        )
    return {**found, "within_own_error": found["errors"]["end"] + own > limit}


def choice_notes(folder: Path, point: Mapping[str, Any]) -> list[str]:
    """What a user should know about a point: that the reference is not as accurate as was wanted, that chance is larger
    than the point's error; a line each.
    """
    study = read_study(folder)
    spread, own = study["spread"] or {}, study["reference"]["error"]
    notes = []
    if not point["errors"]["outcome"]:
        notes.append("note: no settings within that time end as the reference does: a body rests elsewhere with these")
    if point.get("within_own_error"):
        known = "is not known" if own is None else f"is about {length(own)}"
        notes.append(f"note: that is the distance from the study's reference, whose own error {known}")
    if spread.get("chaotic") and point["errors"]["end"] <= spread["end"]:
        apart, ends = length(spread["jitter"]), length(spread["end"])
        notes.append(
            f"note: the scene is chaotic: starts {apart} apart end {ends} apart, and so may scenes that differ a little"
        )
    return notes


def with_point(shot: Shot, point: Mapping[str, Any]) -> Shot:
    """The shot with a point's settings and number of steps."""
    changes = {name: parse_value(text) for name, text in point["changes"].items()}
    words = point["words"]
    steps = int(words[words.index("--steps") + 1])
    if shot.file is None:
        raise InputError("settings of a study need a scene file")
    return load_shot(shot.file, {**shot.parameters, **changes}, steps, trusted=False)


def read_study(folder: Path) -> dict:
    """`study.json` of a folder; InputError where there is none."""
    found = read_json(folder / "study.json") if (folder / "study.json").is_file() else {}
    if found.get("format", 0) < STUDY_FORMAT:
        raise InputError(f"{folder} holds no study of this pdvol; make one by: pdvol study SCENE.py -o {folder}")
    require_no_link_out(folder)
    return found


def _amount(option: str, text: str, units: Mapping[str, float | None]) -> float:
    found = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*([a-z%]+)\s*", text)
    factor = units.get(found.group(2)) if found else None
    try:
        value = float(found.group(1)) * factor if found and factor else 0.0
    except ValueError:
        value = 0.0
    if not value > 0.0:
        raise InputError(
            f"{option} {text}: write a number and its unit, {', '.join(units)}, as in 5{next(iter(units))}"
        )
    return value
