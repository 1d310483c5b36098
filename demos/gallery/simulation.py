"""The run of an entry: made once, gone on with after an interruption, with a note of commits and machine."""

import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.commits import MissingObject, Repository
from benchmarks.common.process import machine
from demos.gallery.entries import DEMOS, Entry
from pdvol.errors import SimulationError
from pdvol.runs.runner import Execution, run_scene
from pdvol.runs.scene_file import load_module, load_shot
from pdvol.store.files import read_json, write_json
from pdvol.store.folder import holds_run
from pdvol.store.reader import Run, open_run
from pdvol.studio.wedge.scored_body import at_level

TIES = ("consistency", "feedback")
"""Settings of the method `progressive` that tie a level to the one below it."""


def simulate(entry: Entry, folder: Path, method: str = "progressive") -> Run:
    """The stored run of an entry by a method; what is missing is simulated, in a process of its own.

    Raises
    ------
    SimulationError
        The run failed; its own message is on standard error.
    """
    finest = load_shot(entry.file, entry.settings).scene.levels - 1
    levels = open_run(folder).levels if holds_run(folder) else ()
    if len(levels) <= finest or any(level.info["state"] != "done" for level in levels[: finest + 1]):
        if _march(entry, folder, method):
            raise SimulationError(f"{entry.name} was not simulated to its end; the same command goes on with it")
    return at_level(open_run(folder), finest)


def _march(entry: Entry, folder: Path, method: str) -> int:
    """Simulate what is missing, in a process of its own; its exit status."""
    there = holds_run(folder)
    commits = [*(note(folder).get("commits", ()) if there else ()), commit()]
    folder.parent.mkdir(parents=True, exist_ok=True)
    write_json(_note_file(folder), {"commits": list(dict.fromkeys(commits)), **machine()})
    words = ["run", str(entry.file), "--out", str(folder), "--no-picture", "--no-xdmf", "--method", method]
    words += ["--ranks", "1"]  # times on pages are comparable
    words += [word for name, value in settings_by(entry, method).items() for word in ("--set", f"{name}={value}")]
    words += ["--resume"] * there
    return subprocess.run([sys.executable, "-m", "pdvol", *words]).returncode


def settings_by(entry: Entry, method: str) -> dict[str, Any]:
    """The entry's settings, without those that a method does not know: levels that run alone have no ties."""
    return {name: value for name, value in entry.settings.items() if method == "progressive" or name not in TIES}


def simulate_small(entry: Entry, folder: Path) -> Run:
    """A run of an entry that takes seconds, for tests."""
    run_scene(load_shot(entry.file, {**entry.settings, **entry.small}), folder, last=1, how=Execution(xdmf=False))
    return open_run(folder)


def note(folder: Path) -> Mapping[str, Any]:
    """Where a run was made: `commits`, `processor`, `cores` and `load` at its start; empty where nothing is known."""
    return read_json(_note_file(folder)) if _note_file(folder).is_file() else {}


def _note_file(folder: Path) -> Path:
    """Beside the run folder, which is empty before a run."""
    return folder.with_name(f"{folder.name}.json")


def commit() -> str:
    """The commit that is checked out; empty outside a repository."""
    try:
        return Repository(DEMOS.parent).head()
    except MissingObject:
        return ""


def claims(entry: Entry, run: Run) -> list[tuple[str, bool]]:
    """What the demo claims about a run, and whether it holds."""
    return [(sentence, bool(holds)) for sentence, holds in load_module(entry.file).claim(run)]
