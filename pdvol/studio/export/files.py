"""What formats share in writing files: whole or not at all, with scripts and textures beside them.

A script opens an export in the other program's own Python. Its text is `pdvol/studio/export/NAME.txt`, where one line
stands for the values that belong to the export.
"""

import errno
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count
from pathlib import Path
from typing import Any

from pdvol.errors import SimulationError
from pdvol.store.files import TEMPORARY, require_room, write_bytes
from pdvol.studio.export.parts import Part

LONGEST_REASON = 160  # characters of a library's own message that fit into one line
VALUES_LINE = "# <values>\n"  # of a script's text: the export's values take its place


def failure_reason(error: Exception) -> str:
    """Why a library could not write, in the operating system's words where its error quotes them."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    text = " ".join(str(error).split())
    quoted = (os.strerror(number) for number in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT))
    return next((reason for reason in quoted if reason in text), text[:LONGEST_REASON])


@contextmanager
def written_aside(
    path: Path, size: int, ending: str = "", taken: Callable[[Path], object] = lambda aside: False
) -> Iterator[Path]:
    """The name under which a file of at most `size` bytes is written. It gets the name `path` once it is whole; nothing
    is left of it where that fails. The name ends in `ending`, and is none of those that are `taken`.

    Raises
    ------
    SimulationError
        The disk cannot be written.
    """
    asides = (path.with_name(f".{path.name}{number or ''}{TEMPORARY}{ending}") for number in count())
    aside = next(place for place in asides if not taken(place))
    require_room(aside, size)
    try:
        yield aside
        with open(aside, "rb") as file:
            os.fsync(file.fileno())
        os.replace(aside, path)
    except (OSError, RuntimeError) as error:  # libraries raise either for a full disk
        raise SimulationError(f"cannot write {path}: {failure_reason(error)}") from error
    finally:
        aside.unlink(missing_ok=True)


def made_folder(folder: Path) -> Path:
    """The folder, which is made where there is none; SimulationError where it cannot be."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SimulationError(f"cannot write {folder}: {error.strerror}") from error
    return folder


def write_script(out: Path, name: str, **values: Any) -> Path:
    """Write `out/NAME.py` with the values as assignments, and `WRITTEN_TO`, the folder; returns its path.
    SimulationError: the disk is full.
    """
    text = Path(__file__).with_name(f"{name}.txt").read_text()
    assignments = "".join(f"{key} = {value!r}\n" for key, value in {**values, "WRITTEN_TO": str(out.resolve())}.items())
    path = made_folder(out) / f"{name}.py"
    write_bytes(path, text.replace(VALUES_LINE, assignments).encode())
    return path


def copy_texture(part: Part, folder: Path) -> str:
    """Copy the texture of a part into a folder of textures, named after it; its path from the folder above, empty where
    the part has none. SimulationError: the disk cannot be written.
    """
    if part.render is None or part.render.texture is None:
        return ""
    file = made_folder(folder) / f"{part.name}{part.render.texture.suffix}"
    try:
        shutil.copyfile(part.render.texture, file)
    except OSError as error:
        raise SimulationError(f"cannot write {file}: {error.strerror}") from error
    return f"{folder.name}/{file.name}"
