"""VTKHDF time series (UnstructuredGrid), for ParaView and pyvista; the format that follows XDMF.

    level_<l>.vtkhdf                    all steps, version 2.0: the oldest one with times; ParaView 5.12 and newer
    level_<l>.hdf.series                the same for ParaView 5.11, which reads version 1.0 without times: a list of
    level_<l>_steps/<step>.hdf          one file a step, version 1.0, that refers to the arrays of level_<l>.vtkhdf
    open_in_paraview.py                 opens whichever ParaView can read

The rest mesh is stored once. The fields of all steps are stored one behind the other, and `Steps` holds where each
step's begin. Move the files together.
"""

from collections.abc import Sequence
from pathlib import Path

import h5py
import numpy as np

from pdvol.errors import InputError
from pdvol.store.reader import Run
from pdvol.store.series import Fields, LevelFields, Series, in_3d, nothing_more
from pdvol.studio.export.files import write_paraview_script, written_aside
from pdvol.studio.export.vtkhdf_steps import write_steps

_CELL_TYPES = {2: 5, 3: 10}  # VTK_TRIANGLE, VTK_TETRA


def export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields) -> list[Path]:
    """Write `out/level_<l>.vtkhdf` for each level, and what ParaView needs beside. See `pdvol.studio.export`."""
    written = [write_vtkhdf(run, level, out / f"level_{level}.vtkhdf", fields(level)) for level in levels]
    lists = [write_steps(path) for path in written]
    return [*written, *lists, write_paraview_script(run, levels, out, ".vtkhdf")]


def write_vtkhdf(run: Run, level: int, path: str | Path, more: Fields = nothing_more) -> Path:
    """Export the stored steps of one level, as `write_xdmf` does; the file's name ends in .vtkhdf. Written aside and
    renamed.
    """
    path = Path(path)
    if path.suffix != ".vtkhdf":
        raise InputError(f"{path}: the name of a VTKHDF file ends in .vtkhdf")
    series = Series(run, level, more)
    with written_aside(path, series.size) as aside, h5py.File(aside, "w") as file:
        _write_data(file.create_group("VTKHDF"), series)
    return path


def _write_data(root: h5py.Group, series: Series) -> None:
    rest, cells, steps = series.level.rest, series.level.cells, series.steps
    root.attrs["Version"] = (2, 0)
    root.attrs.create("Type", b"UnstructuredGrid", dtype=h5py.string_dtype("ascii", len("UnstructuredGrid")))
    sizes = {"NumberOfPoints": len(rest), "NumberOfCells": len(cells), "NumberOfConnectivityIds": cells.size}
    for name, size in sizes.items():
        root[name] = np.array([size])
    root["Points"] = in_3d(rest)
    root["Connectivity"] = cells.ravel()
    root["Offsets"] = np.arange(len(cells) + 1) * cells.shape[1]
    root["Types"] = np.full(len(cells), _CELL_TYPES[rest.shape[1]], dtype=np.uint8)
    times = root.create_group("Steps")
    times.attrs["NSteps"] = steps
    times["Values"] = np.arange(steps) * series.dt
    # One part, the same mesh at every step.
    times["NumberOfParts"] = np.ones(steps, dtype=np.int64)
    for name in ("PartOffsets", "PointOffsets"):
        times[name] = np.zeros(steps, dtype=np.int64)
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        times[name] = np.zeros((steps, 1), dtype=np.int64)
    for label, values in series.labels.items():
        root[f"CellData/{label}"] = values
        times[f"CellDataOffsets/{label}"] = np.zeros(steps, dtype=np.int64)
    for step, _, fields in series:
        for kind, arrays in (("PointData", fields.points), ("CellData", fields.cells)):
            for label, values in arrays.items():
                _append(root, times, kind, label, np.asarray(values), step, steps)


def _append(
    root: h5py.Group, times: h5py.Group, kind: str, label: str, values: np.ndarray, step: int, steps: int
) -> None:
    key, n = f"{kind}/{label}", len(values)
    if step == 0:
        root.create_dataset(key, (steps * n, *values.shape[1:]), dtype=values.dtype)
        times[f"{kind}Offsets/{label}"] = np.arange(steps, dtype=np.int64) * n
    root[key][step * n : (step + 1) * n] = values
