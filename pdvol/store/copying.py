"""A second folder with the states of a run, whole or up to a step, even while the run is written."""

import shutil
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from pdvol.errors import InputError, SimulationError
from pdvol.store.files import TEMPORARY, jsonable, write_json
from pdvol.store.folder import RECORD, RUN_FORMAT, late_file, level_folder, run_state
from pdvol.store.log import write_known
from pdvol.store.reader import Run, open_run
from pdvol.store.states import States


def copy_run(source: Path, target: Path, steps: int | None = None, levels: int | None = None) -> dict:
    """Copy a run; states that `target` has of the same run already are left.

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
        for file in _files(run, counts):
            copied = target / file.relative_to(source)
            copied.parent.mkdir(parents=True, exist_ok=True)
            aside = copied.with_name(f".{copied.name}{TEMPORARY}")
            shutil.copyfile(file, aside)
            aside.replace(copied)
        for level, count in zip(kept, counts, strict=True):
            States(level_folder(target, level.index), level.rest.shape).extend(level.positions, count)
        if run.hand is not None:
            shutil.copyfile(run.hand.file, target / RECORD)
            if steps is not None:
                replace(run.hand, file=target / RECORD).keep(steps - 1)
    except OSError as error:
        raise SimulationError(f"cannot copy {source} to {target}: {error.strerror or error}") from error
    write_known(source / "log.jsonl", target / "log.jsonl", dict(enumerate(counts)))
    for entry, count, level in zip(entries, counts, kept, strict=True):
        if entry["state"] == "running" or count < level.steps:
            entry["state"] = "interrupted"
    info = {**jsonable(run.info), "format": RUN_FORMAT, "levels": entries, "state": run_state(entries)}
    write_json(target / "run.json", info)
    return info


def _files(run: Run, counts: Sequence[int]) -> Iterator[Path]:
    """All that is copied as it is, with so many states of the coarsest levels; lists after the files that they name."""
    for level, count in zip(run.levels, counts, strict=False):
        late = (late_file(level.folder, step) for step in range(count))
        yield from (f for f in (level.folder / "mesh.npz", level.folder / "velocity.npy", *late) if f.exists())
        yield from sorted(level.folder.glob("render_*.npz"))
    for name in ("obstacles", "render"):
        yield from sorted((run.path / name).glob("[0-9]*"))
        yield from run.path.glob(f"{name}.json")


def require_new(path: Path) -> None:
    """InputError where there is something at `path` already, other than an empty folder."""
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise InputError(f"{path} is there already: choose another name")
