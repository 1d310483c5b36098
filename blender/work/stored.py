"""What pdvol has written: levels and settings of runs, the variations of a wedge, the findings of a check."""

import json
from pathlib import Path
from typing import Any

from .process import with_settings
from .progress import RunProgress


def stored_levels(run: Path) -> dict[int, int]:
    """The last stored step of each level of a run folder; empty where there is none."""
    progress = RunProgress(run)
    progress.look()
    return progress.reached


def stored_settings(run: Path) -> dict[str, str]:
    """The parameters that a run was given, as `--set` takes them."""
    given = _json(run / "run.json").get("parameters", {})
    return {name: repr(value) for name, value in given.items()}


def is_preview(run: Path) -> bool:
    """Whether a run folder holds a preview that is nothing else: neither refined, nor chosen, nor begun by another."""
    branched = "branched" in _json(run / "run.json")
    return list(stored_levels(run)) == [0] and not stored_settings(run) and not branched


def variations(wedge: Path) -> dict[int, dict[str, str]]:
    """What each variation of a wedge that has run has changed, by its number."""
    entries = _json(wedge / "wedge.json").get("variations", [])
    return {int(e["number"]): dict(e.get("changes", {})) for e in entries if e.get("state") == "done"}


def findings(file: Path) -> tuple[list[str], list[str]]:
    """What a check has found: defects, and notes with what each level costs, a line each."""
    found = _json(file)
    costs = [
        f"level {level['level']}: {level['vertices']:,} vertices, about {level['seconds']:,.0f} s"
        for level in found.get("levels", [])
        if "seconds" in level
    ]
    return [with_settings(line) for line in found.get("defects", [])], [*costs, *found.get("notes", [])]


def _json(path: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(path.read_text()))
    except (OSError, ValueError):
        return {}
