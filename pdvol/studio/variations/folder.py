"""The folder of many runs: a study or a wedge of one scene, kept by one process at a time."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from pdvol.errors import InputError
from pdvol.store.files import jsonable, lock, make_folder, read_json, write_json


def take_folder(file: Path, number: int, description: dict, empty: Mapping[str, Any]) -> TextIO:
    """Make a folder, or go on with the one that is there, and lock it.

    Parameters
    ----------
    file : `study.json` or `wedge.json` in it; its name says what the folder is
    number : of the file's format
    description : of the scene; the one that a folder has must be the same
    empty : what a new file holds besides

    Returns
    -------
    file
        The lock, held until it is closed.

    Raises
    ------
    InputError
        The folder belongs to another scene or holds other files, cannot be made, or another process uses it.
    """
    out, kind = file.parent, file.stem
    description = jsonable(description)
    if file.exists():
        stored = read_json(file)
        if stored.get("format") != number:
            raise InputError(f"{file} has another format; choose another folder")
        if stored.get("description") != description:
            raise InputError(f"{out} holds a {kind} of another scene or other settings; choose another folder")
    else:
        if out.exists() and not out.is_dir():
            raise InputError(f"{out} is a file, not a folder")
        if out.exists() and any(path.name != f"{kind}.lock" for path in out.iterdir()):
            raise InputError(f"{out} is not empty and holds no {kind}; choose another folder")
        make_folder(out)
    held = lock(out / f"{kind}.lock")
    if held is None:
        raise InputError(f"{out} is used by another pdvol {kind}: wait for it to end, or choose another folder")
    if not file.exists():
        write_json(file, {"format": number, "description": description, **empty})
    return held
