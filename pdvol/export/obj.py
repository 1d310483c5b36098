"""Moving surfaces as sequences of OBJ files, one folder a level and one file a step."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import SimulationError
from pdvol.export.body_surfaces import body_surfaces
from pdvol.export.series import LevelFields, Series, padded
from pdvol.store.files import write_bytes
from pdvol.store.reader import Run


def export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields) -> list[Path]:
    """Write `out/level_<l>/000000.obj` and so on; OBJ files hold no fields. See `pdvol.export`."""
    return [write_obj(run, level, out / f"level_{level}") for level in levels]


def write_obj(run: Run, level: int, folder: str | Path) -> Path:
    """Export each stored step of one level as `folder/000000.obj`, `000001.obj` ...; each file is written aside and
    renamed.

    Returns
    -------
    Path
        The folder.

    Raises
    ------
    InputError
        When the level does not exist or has no state.
    SimulationError
        When the disk cannot be written.
    """
    folder, series = Path(folder), Series(run, level)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SimulationError(f"cannot write {folder}: {error.strerror}") from error
    surfaces = body_surfaces(run, series.level)
    # One numbering for all bodies, in the input's order.
    used = np.unique(np.concatenate([surface.vertices for _, surface in surfaces]))
    parts = []
    for name, surface in surfaces:
        numbers = np.searchsorted(used, surface.vertices) + 1
        corners = np.asarray(numbers)[surface.faces]
        parts.append("\n".join([f"o {name}", *("f {} {} {}".format(*row) for row in corners.tolist()), ""]))
    for step in range(series.steps):
        points = padded(series.level.positions(step)[used])
        lines = "".join("v {!r} {!r} {!r}\n".format(*row) for row in points.tolist())
        write_bytes(folder / f"{step:06d}.obj", (lines + "".join(parts)).encode())
    return folder
