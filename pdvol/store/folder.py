"""The layout of a run folder, and the lock that lets one process write there.

| file | content |
|---|---|
| run.json | parameters, versions, sizes, state |
| run.lock | locked while a process writes |
| log.jsonl | one object for each level and step |
| hand.jsonl | what a hand did in each step (`pdvol.scene.hand`) |
| obstacles.json, obstacles/<i>.npz | obstacles, for pictures |
| render.json, render/<i>.npz, levels/<l>/render_<i>.npz | surfaces drawn in the place of bodies |
| levels/<l>/mesh.npz | points, cells, bodies, regions, places |
| levels/<l>/velocity.npy | initial velocity (n, d) [m/s] |
| levels/<l>/states.bin | positions (n, d) [m] of each step, in the input's order |
| levels/<l>/late_<step>.npz | places of obstacles that contact held back |
"""

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

from pdvol.errors import InputError
from pdvol.store.files import TEMPORARY, lock, make_folder, read_json, require_place, write_json

RUN_FORMAT = 2  # of run.json: increased when an older pdvol cannot read new folders
OLD_FORMAT = 1  # is read, and converted by the next process that writes
RECORD = "hand.jsonl"  # name of the record of what a hand did
# States of levels. A run has the first one that any of its levels has.
LEVEL_STATES = ("running", "failed", "interrupted", "done", "pending")


def level_folder(path: Path, level: int) -> Path:
    """Where a run keeps one level."""
    return path / "levels" / str(level)


def last_write(path: Path) -> float:
    """When states of a run were written last [ns], as files have it; infinity where there are none."""
    return max((file.stat().st_mtime_ns for file in path.glob("levels/*/states.bin")), default=float("inf"))


def is_newer(file: Path, path: Path) -> bool:
    """Whether a file of a run was written after all of its states."""
    return file.exists() and file.stat().st_mtime_ns > last_write(path)


def late_file(folder: Path, step: int) -> Path:
    """Where a level's folder keeps the places of obstacles that contact holds back at a step."""
    return folder / f"late_{step:06d}.npz"


def read_info(path: Path) -> dict:
    """`run.json` of a run folder; InputError when it is no run, or one of another format."""
    try:
        info = read_json(path / "run.json")
    except FileNotFoundError as error:
        what = "is not a run folder: it has no run.json" if path.is_dir() else "does not exist"
        raise InputError(f"{path} {what}") from error
    if info.get("format") not in (OLD_FORMAT, RUN_FORMAT):
        raise InputError(
            f"{path} is a run of format {info.get('format')!r}, this pdvol reads formats {OLD_FORMAT} and {RUN_FORMAT}:"
            " use the pdvol that wrote it"
        )
    _require_entries(path, info, "dt", "levels")
    if "hand" in info:  # the folder may have moved
        info["hand"] = str(path.resolve() / RECORD)
    return info


def require_scene(path: Path, info: dict) -> None:
    """InputError unless `run.json` has the entries about the simulated scene that `pdvol run` writes."""
    _require_entries(
        path, info, "scene", "scene_file", "steps", "method", "prolongation", "parameters", "description", "diagonal"
    )


def _require_entries(path: Path, info: dict, *needed: str) -> None:
    """InputError unless `run.json` has these entries, and all that readers rely on are as pdvol writes them."""
    for key, sound in _SOUND.items():
        if key in needed and key not in info:
            raise InputError(f"{path / 'run.json'} lacks {key}; put back the file as pdvol wrote it")
        if key in info and not sound(info[key]):
            raise InputError(f"{path / 'run.json'} lacks its {key}: put back the file as pdvol wrote it")


def _is(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kind) and not isinstance(value, bool)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_level(entry: Any) -> bool:
    return (
        isinstance(entry, dict)
        and all(isinstance(entry.get(key), int) for key in ("vertices", "cells"))
        and entry.get("state") in LEVEL_STATES
    )


_SOUND: dict[str, Callable[[Any], bool]] = {
    **dict.fromkeys(("scene", "scene_file", "method", "prolongation", "state"), _is(str)),
    **dict.fromkeys(("parameters", "description", "versions"), _is(dict)),
    **dict.fromkeys(("dt", "diagonal"), lambda value: _is_number(value) and 0.0 < value < math.inf),
    "steps": lambda value: _is(int)(value) and 0 <= value < 2**31,
    "solvers": _is(list),
    "bodies": lambda value: isinstance(value, list) and all(isinstance(name, str) for name in value),
    "up": lambda value: isinstance(value, list) and len(value) in (2, 3) and all(map(_is_number, value)),
    "levels": lambda value: isinstance(value, list) and all(map(_is_level, value)),
}
"""Whether an entry of `run.json` is as pdvol writes it."""


def holds_run(path: Path) -> bool:
    """Whether a folder holds a run with a state; one whose creation was killed may be replaced."""
    return (path / "run.json").exists() and read_info(path).get("state") != "creating"


def keep_late(folder: Path, steps: int) -> None:
    """Remove the places of obstacles in a level's folder from `steps` on."""
    for file in folder.glob("late_*.npz"):
        if int(file.stem.removeprefix("late_")) >= steps:
            file.unlink()


def run_state(levels: list[dict]) -> str:
    """The state of a run, given the entries of its levels: the first of LEVEL_STATES that one of them has."""
    present = {entry["state"] for entry in levels}
    return next((state for state in LEVEL_STATES if state in present), "pending")


def claim(path: Path, replace: bool = False) -> TextIO:
    """Make or take a folder for a new run, and lock it: `require_free` says which. A run that `replace` removes leaves
    what other commands have put beside it.

    Returns
    -------
    file
        The lock, held until it is closed.

    Raises
    ------
    InputError
        The folder holds a run or other files, cannot be made, or another process writes there.
    """
    require_free(path, replace)
    make_folder(path)
    held = hold(path)
    try:
        require_free(path, replace)  # another process may have started a run before this one had the lock
        if holds_run(path):
            _discard(path)
    except InputError:
        held.close()
        raise
    return held


def _discard(path: Path) -> None:
    """Remove a run, so that a kill leaves what may be replaced."""
    write_json(path / "run.json", {**read_info(path), "state": "creating"})
    for name in ("log.jsonl", RECORD, "obstacles.json", "render.json"):
        (path / name).unlink(missing_ok=True)
    for name in ("levels", "obstacles", "render"):
        shutil.rmtree(path / name, ignore_errors=True)


def require_free(path: Path, replace: bool = False) -> None:
    """InputError unless a run may be created here: in a folder that is new, empty, or left by a creation that was
    killed; with `replace` also in the place of a run.
    """
    require_place(path)
    if holds_run(path):
        if not replace:
            raise InputError(
                f"{path} already holds a run; go on with it by --resume (resume=True), or choose another folder"
            )
    elif path.exists() and not (path / "run.json").exists():
        if any(not (p.name == "run.lock" or p.name.endswith(TEMPORARY)) for p in path.iterdir()):
            raise InputError(f"{path} is not empty and holds no run: choose another folder")


def hold(path: Path) -> TextIO:
    """The run's lock, held until it is closed; InputError where another process holds it."""
    try:
        held = lock(path / "run.lock")
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror or error}") from error
    if held is None:
        raise InputError(in_use(path))
    return held


def in_use(path: Path) -> str:
    """The message of errors where another process writes the run."""
    return f"{path} is being written by another pdvol: wait for it to end, or choose another folder"
