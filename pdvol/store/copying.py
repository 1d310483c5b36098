"""A second folder with the states of a run, whole or up to a step, even while the run is written."""

import shutil
from pathlib import Path

from pdvol.errors import InputError, SimulationError
from pdvol.store.files import jsonable, write_bytes, write_json
from pdvol.store.folder import RUN_FORMAT, late_file, level_folder, run_state
from pdvol.store.log import log_line, read_log
from pdvol.store.reader import open_run
from pdvol.store.render_meshes import render_files
from pdvol.store.states import States

MESH_FILES = ("mesh.npz", "velocity.npy")  # of a level


def copy_run(source: Path, target: Path, steps: int | None = None, levels: int | None = None) -> dict:
    """Copy a run; what `target` has of the same run already is left.

    States come before `run.json`, so that a reader finds a whole run or none. A level that another process is writing
    is "interrupted" in the copy.

    Parameters
    ----------
    source, target : run folders
    steps : states of each level to copy, step 0 included; all that are whole when None
    levels : coarsest levels to copy; all when None

    Returns
    -------
    dict
        The copy's `run.json`.

    Raises
    ------
    InputError
        `source` is no run, or one of these states is damaged.
    SimulationError
        The disk cannot be written.
    """
    run = open_run(source)
    kept = run.levels[:levels]
    counts = [level.steps if steps is None else min(level.steps, steps) for level in kept]
    entries = [dict(level.info) for level in kept]
    try:
        for level, count in zip(kept, counts, strict=True):
            folder = level_folder(target, level.index)
            folder.mkdir(parents=True, exist_ok=True)
            late = [late_file(level.folder, step) for step in range(count)]
            for file in (*(level.folder / name for name in MESH_FILES), *late):
                if not (folder / file.name).exists() and file.exists():
                    _copy(file, folder / file.name)
            States(folder, level.rest.shape).extend(level.positions, count)
        if (source / "obstacles.json").exists():
            shutil.copytree(source / "obstacles", target / "obstacles", dirs_exist_ok=True)
            _copy(source / "obstacles.json", target / "obstacles.json")
        for file in render_files(source, len(kept)):
            (target / file.relative_to(source)).parent.mkdir(exist_ok=True)
            _copy(file, target / file.relative_to(source))
    except OSError as error:
        raise SimulationError(f"cannot copy {source} to {target}: {error.strerror or error}") from error
    records = [
        record
        for record in read_log(source / "log.jsonl")
        if record.get("level", 0) < len(kept) and record.get("step", 0) < counts[record.get("level", 0)]
    ]
    write_bytes(target / "log.jsonl", b"".join(log_line(record) for record in records))
    for entry, count, level in zip(entries, counts, kept, strict=True):
        if entry["state"] == "running" or count < level.steps:
            entry["state"] = "interrupted"
    info = {**jsonable(run.info), "format": RUN_FORMAT, "levels": entries, "state": run_state(entries)}
    write_json(target / "run.json", info)
    return info


def _copy(file: Path, target: Path) -> None:
    aside = target.with_name(f".{target.name}.tmp")
    shutil.copyfile(file, aside)
    aside.replace(target)


def require_new(path: Path) -> None:
    """InputError where there is something at `path` already, other than an empty folder."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise InputError(f"{path} is there already: choose another name")
