"""The layout of a run folder, and the lock that lets one process write there.

| file | content |
|---|---|
| run.json | parameters, versions, sizes, state |
| run.lock | locked while a process writes |
| log.jsonl | one object for each level and step |
| obstacles.json, obstacles/<i>.npz | obstacles, for pictures |
| render.json, render/<i>.npz, levels/<l>/render_<i>.npz | surfaces drawn in the place of bodies |
| levels/<l>/mesh.npz | points, cells, bodies, regions, surface |
| levels/<l>/velocity.npy | initial velocity (n, d) [m/s] |
| levels/<l>/states.bin | positions (n, d) [m] of each step, in the input's order |
| levels/<l>/late_<step>.npz | places of obstacles that contact held back |
"""

import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.store.files import (
    TEMPORARY,
    jsonable,
    lock,
    make_folder,
    read_json,
    require_place,
    sync_file,
    write_array,
    write_arrays,
    write_json,
)
from pdvol.store.states import States

RUN_FORMAT = 2  # of run.json: increased when an older pdvol cannot read new folders
OLD_FORMAT = 1  # is read, and converted by the next process that writes
_INFO_TYPES = {
    "scene": str,
    "scene_file": str,
    "steps": int,
    "method": str,
    "prolongation": str,
    "parameters": dict,
    "description": dict,
    "diagonal": float,
    "solvers": list,
    "bodies": list,
    "versions": dict,
    "up": list,
    "state": str,
}
# States of levels. A run has the first one that any of its levels has.
LEVEL_STATES = ("running", "failed", "interrupted", "done", "pending")


def level_folder(path: Path, level: int) -> Path:
    """Where a run keeps one level."""
    return path / "levels" / str(level)


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
    _check_info(path / "run.json", info)
    return info


def _check_info(file: Path, info: dict) -> None:
    """InputError unless the entries of `run.json` have the types that its readers rely on."""
    levels, dt = info.get("levels"), info.get("dt")
    if (
        not isinstance(levels, list)
        or not all(isinstance(entry, dict) for entry in levels)
        or isinstance(dt, bool)
        or not isinstance(dt, (int, float))
        or not 0 < dt < math.inf
    ):
        raise InputError(f"{file} lacks the list of levels or the time step dt")
    for key, kind in _INFO_TYPES.items():
        if key in info and (not isinstance(info[key], kind) or isinstance(info[key], bool)):
            raise InputError(f"{file}: {key} is not of the type {kind.__name__}; put back the file as pdvol wrote it")
    for number, entry in enumerate(levels):
        if (
            not isinstance(entry.get("vertices"), int)
            or not isinstance(entry.get("cells"), int)
            or entry.get("state") not in LEVEL_STATES
        ):
            raise InputError(
                f"{file}: level {number} lacks its vertices, cells or state; put back the file as pdvol wrote it"
            )
    if not all(isinstance(name, str) for name in info.get("bodies", [])) or not 0 <= info.get("steps", 0) < 2**31:
        raise InputError(f"{file}: bodies or steps are not what pdvol wrote; put back the file")
    if not 0.0 < info.get("diagonal", 1.0) < math.inf:
        raise InputError(f"{file}: diagonal is no length; put back the file as pdvol wrote it")
    up = info.get("up", [0.0, 0.0, 1.0])
    if len(up) not in (2, 3) or not all(isinstance(c, (int, float)) for c in up):
        raise InputError(f"{file}: up is no vector")


def require_scene(path: Path, info: dict) -> None:
    """InputError unless `run.json` has the entries about the simulated scene that `pdvol run` writes."""
    missing = [
        key
        for key in ("scene", "scene_file", "steps", "method", "prolongation", "parameters", "description", "diagonal")
        if key not in info
    ]
    if missing:
        raise InputError(f"{path / 'run.json'} lacks {', '.join(missing)}; put back the file as pdvol wrote it")


def holds_run(path: Path) -> bool:
    """Whether a folder holds a run with a state; one whose creation was killed may be replaced."""
    return (path / "run.json").exists() and read_info(path).get("state") != "creating"


def new_info(info: Mapping, body_names: Sequence[str]) -> dict:
    """`run.json` of a run about to be created, in the state "creating": a folder that a kill leaves in it has no step
    and may be replaced.
    """
    missing = [key for key in ("dt", "steps") if key not in info]
    if missing:
        raise InputError(f"a run needs {missing} in its info")
    return {
        **jsonable(info),
        "format": RUN_FORMAT,
        "bodies": [str(name) for name in body_names],
        "levels": [],
        "state": "creating",
    }


def keep_late(folder: Path, steps: int) -> None:
    """Remove the places of obstacles in a level's folder from `steps` on."""
    for file in folder.glob("late_*.npz"):
        if int(file.stem.removeprefix("late_")) >= steps:
            file.unlink()


def run_state(levels: list[dict]) -> str:
    """The state of a run, given the entries of its levels: the first of LEVEL_STATES that one of them has."""
    present = {entry["state"] for entry in levels}
    return next((state for state in LEVEL_STATES if state in present), "pending")


def write_level(path: Path, level: int, mesh: LevelMesh, velocity: np.ndarray | None) -> dict:
    """Store a level's mesh and initial velocity (n, d) [m/s] (at rest when None); returns its entry in `run.json`."""
    points = np.asarray(mesh.points, dtype=np.float64)
    v = np.zeros_like(points) if velocity is None else np.ascontiguousarray(velocity, dtype=np.float64)
    if v.shape != points.shape:
        raise InputError(f"level {level}: the initial velocity has shape {v.shape}, the mesh {points.shape}")
    folder = level_folder(path, level)
    folder.mkdir(parents=True, exist_ok=True)
    States(folder, points.shape).create()
    write_arrays(
        folder / "mesh.npz",
        points=points,
        cells=mesh.cells,
        bodies=mesh.bodies,
        regions=mesh.regions,
        surface=mesh.boundary,
    )
    write_array(folder / "velocity.npy", v)
    sync_file(folder.parent)
    return {"vertices": len(points), "cells": len(mesh.cells), "state": "pending"}


def claim(path: Path, replace: bool = False) -> TextIO:
    """Make or take a folder for a new run, and lock it. It must be new, empty, or left by a creation that was killed;
    with `replace` a run that it holds is removed, and what other commands have put beside it stays.

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
        if replace and holds_run(path):
            _discard(path)
        require_free(path)  # another process may have started a run before this one had the lock
    except InputError:
        held.close()
        raise
    return held


def _discard(path: Path) -> None:
    """Remove a run, so that a kill leaves what may be replaced."""
    write_json(path / "run.json", {**read_info(path), "state": "creating"})
    for name in ("log.jsonl", "obstacles.json", "render.json"):
        (path / name).unlink(missing_ok=True)
    for folder in (path / name for name in ("levels", "obstacles", "render")):
        if folder.exists():
            shutil.rmtree(folder)


def require_free(path: Path, replace: bool = False) -> None:
    """InputError unless a run may be created here; with `replace` in the place of one."""
    require_place(path)
    if not path.exists():
        return
    if holds_run(path) and not replace:
        raise InputError(f"{path} already holds a run: continue it with --resume or choose another folder")
    if not (path / "run.json").exists() and any(
        not (p.name == "run.lock" or p.name.endswith(TEMPORARY)) for p in path.iterdir()
    ):
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
