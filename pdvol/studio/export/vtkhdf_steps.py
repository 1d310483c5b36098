"""One VTKHDF file a step, version 1.0, beside a time series: ParaView 5.11 has no times in VTKHDF, and reads the
steps' list `level_<l>.hdf.series` instead.

The files hold no arrays. The mesh is linked, and a step's fields are virtual datasets: pieces of the time series' own
arrays. HDF5 1.10 and newer follow both.
"""

import json
import os
from pathlib import Path

import h5py
import numpy as np

from pdvol.errors import SimulationError
from pdvol.store.files import TEMPORARY, write_bytes
from pdvol.studio.export.files import failure_reason

_MESH = ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds", "Points", "Connectivity", "Offsets", "Types")


def write_steps(series: Path) -> Path:
    """Write the steps of the time series `level_<l>.vtkhdf`, each file aside and renamed, and their list.

    Returns
    -------
    Path
        `level_<l>.hdf.series`, a JSON file by ParaView's specification of file series.

    Raises
    ------
    SimulationError
        When the disk cannot be written.
    """
    folder, index = series.with_name(f"{series.stem}_steps"), series.with_suffix(".hdf.series")
    files = []
    try:
        folder.mkdir(exist_ok=True)
        with h5py.File(series) as file:
            times = file["VTKHDF/Steps/Values"][:]
            for step, time in enumerate(times):
                path = folder / f"{step:06d}.hdf"
                aside = path.with_name(f".{path.name}{TEMPORARY}")
                with h5py.File(aside, "w") as one:
                    _write_step(one, file["VTKHDF"], f"../{series.name}", step)
                os.replace(aside, path)
                files.append({"name": f"{folder.name}/{path.name}", "time": float(time)})
        for path in folder.glob("*.hdf"):  # of an earlier export of a run that was rewound since
            if path.stem.isdigit() and int(path.stem) >= len(times):
                path.unlink()
    except (OSError, RuntimeError) as error:
        raise SimulationError(f"cannot write {folder}: {failure_reason(error)}") from error
    write_bytes(index, json.dumps({"file-series-version": "1.0", "files": files}, indent=1).encode())
    return index


def _write_step(file: h5py.File, series: h5py.Group, source: str, step: int) -> None:
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = (1, 0)
    root.attrs["Type"] = np.bytes_(series.attrs["Type"])
    for name in _MESH:
        root[name] = h5py.ExternalLink(source, f"/VTKHDF/{name}")
    for kind, size in (("PointData", "NumberOfPoints"), ("CellData", "NumberOfCells")):
        count = int(series[size][0])
        for label, values in series[kind].items():
            begin = int(series[f"Steps/{kind}Offsets/{label}"][step])
            layout = h5py.VirtualLayout((count, *values.shape[1:]), values.dtype)
            layout[:] = h5py.VirtualSource(source, values.name, values.shape, values.dtype)[begin : begin + count]
            root.create_virtual_dataset(f"{kind}/{label}", layout)
