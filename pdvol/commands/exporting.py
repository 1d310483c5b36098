"""`pdvol export`: the stored levels of a run in the formats of other software, with forces and stresses where the scene
is at hand.
"""

from collections.abc import Sequence
from pathlib import Path

from pdvol.errors import InputError
from pdvol.export.series import Fields, nothing_more
from pdvol.export.surfaces import write_obj, write_usd
from pdvol.export.vtkhdf import write_vtkhdf
from pdvol.export.xdmf import write_xdmf
from pdvol.runs.stored_fields import SceneFields, stored_scene
from pdvol.store.reader import Run, open_run

FORMATS = ("xdmf", "vtkhdf", "obj", "usd")


def export_run(path: str | Path, kind: str, out: str | Path, levels: Sequence[int] | None = None) -> list[str]:
    """Export a stored run, finished or not, into the folder `out`; says what was written.

    Parameters
    ----------
    kind : one of FORMATS
    levels : all that hold a state when None

    Raises
    ------
    InputError
        The folder is no run, a level is missing or empty, the format unknown or its library not installed.
    SimulationError
        `out` cannot be written.
    """
    if kind not in FORMATS:
        raise InputError(f"unknown format {kind!r}; choose one of {', '.join(FORMATS)}")
    run, out = open_run(path), Path(out)
    levels = [level.index for level in run.levels if level.steps] if levels is None else list(levels)
    if not levels:
        raise InputError(f"{path} has no stored state to export")
    if kind == "usd":
        return [str(write_usd(run, levels, out / f"{run.path.resolve().name}.usdc"))]
    if kind == "obj":
        return [str(write_obj(run, level, out / f"level_{level}")) for level in levels]
    write = {"xdmf": write_xdmf, "vtkhdf": write_vtkhdf}[kind]
    lines = []
    try:
        scene, obstacles = stored_scene(run)
    except InputError as error:
        lines.append(f"without contact forces and stresses: {error}")
        more = lambda level: nothing_more
    else:
        more = lambda level: SceneFields(scene, run, level, obstacles)
    written = [str(write(run, level, out / f"level_{level}.{kind}", _fields(run, level, more))) for level in levels]
    return [*written, *lines]


def _fields(run: Run, level: int, more) -> Fields:
    return more(level) if level < len(run.levels) else nothing_more  # the writer tells which levels there are
