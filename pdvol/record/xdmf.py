"""XDMF time series with HDF5 data, for ParaView, Blender's importers and meshio.

`level_N.xdmf` is XML and names `level_N.h5` beside it, so the two can be moved together. The rest geometry and the cells' data are
stored once and referred to by every step; each step adds `displacement` [m] and `velocity` [m/s], of three components in 2D too, for
ParaView warps by vectors of three only. (meshio's own writer puts the HDF5 file into the working directory, hence this one.)
"""

import os
from pathlib import Path
from xml.etree import ElementTree as ET

import h5py
import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.record.files import TEMPORARY, write_bytes
from pdvol.record.reader import Run, RunLevel

_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}


def write_xdmf(run: Run, level: int, path: str | Path) -> Path:
    """Export the stored steps of one level; also of a run that is not finished.

    Parameters
    ----------
    run : Run
    level : int
    path : the .xdmf file; its data goes beside it, with the ending .h5

    Returns
    -------
    Path
        The .xdmf file. It and the .h5 file are written aside and renamed.

    Raises
    ------
    InputError
        When the level does not exist, has no state, or `path` does not end in .xdmf.
    SimulationError
        When the disk cannot be written.
    """
    path = Path(path)
    if path.suffix != ".xdmf":
        raise InputError(f"{path}: the name of an XDMF file ends in .xdmf")
    if not 0 <= level < len(run.levels):
        raise InputError(f"{run.path} has levels 0 to {len(run.levels) - 1}, not {level}")
    stored = run.levels[level]
    steps = stored.steps
    if steps == 0:
        raise InputError(f"{run.path}: level {level} has no stored state to export")
    data = path.with_suffix(".h5")
    aside = data.with_name(f".{data.name}{TEMPORARY}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with h5py.File(aside, "w") as file:
            xml = _write_data(file, data.name, stored, steps, run.dt)
        with open(aside, "rb") as file:
            os.fsync(file.fileno())
        # The data first: an old .xdmf finds its steps in new data, while a new one would miss some in the old.
        os.replace(aside, data)
    except OSError as error:
        raise SimulationError(f"cannot write {data}: {error.strerror or error}") from error
    finally:
        aside.unlink(missing_ok=True)
    ET.indent(xml)
    write_bytes(path, b'<?xml version="1.0"?>\n' + ET.tostring(xml) + b"\n")
    return path


def _write_data(file: h5py.File, name: str, level: RunLevel, steps: int, dt: float) -> ET.Element:
    """Fill the HDF5 file step by step (only one is ever in memory) and return the XML that describes it."""

    def item(parent: ET.Element, key: str, values: np.ndarray) -> None:
        if key not in file:
            file.create_dataset(key, data=values)
        shape = " ".join(str(n) for n in values.shape)
        kind, precision = _TYPES[values.dtype.kind], str(values.dtype.itemsize)
        ET.SubElement(parent, "DataItem", Dimensions=shape, NumberType=kind, Precision=precision, Format="HDF").text = f"{name}:/{key}"

    def attribute(grid: ET.Element, key: str, centre: str, values: np.ndarray, label: str) -> None:
        rank = "Vector" if values.ndim == 2 else "Scalar"
        item(ET.SubElement(grid, "Attribute", Name=label, AttributeType=rank, Center=centre), key, values)

    root = ET.Element("Xdmf", Version="3.0")
    domain = ET.SubElement(root, "Domain")
    series = ET.SubElement(domain, "Grid", Name=f"level {level.index}", GridType="Collection", CollectionType="Temporal")
    rest, cells = level.rest, level.cells
    shape, geometry = ("Triangle", "XY") if rest.shape[1] == 2 else ("Tetrahedron", "XYZ")
    for step in range(steps):
        grid = ET.SubElement(series, "Grid", Name=f"step {step}", GridType="Uniform")
        # Every step names the shared mesh itself: readers without XInclude understand it too.
        item(ET.SubElement(grid, "Topology", TopologyType=shape, NumberOfElements=str(len(cells))), "mesh/cells", cells)
        item(ET.SubElement(grid, "Geometry", GeometryType=geometry), "mesh/points", rest)
        ET.SubElement(grid, "Time", Value=repr(step * dt))
        attribute(grid, f"steps/{step}/displacement", "Node", _padded(level.positions(step) - rest), "displacement")
        attribute(grid, f"steps/{step}/velocity", "Node", _padded(level.velocities(step)), "velocity")
        attribute(grid, "mesh/body", "Cell", level.bodies, "body")
        attribute(grid, "mesh/region", "Cell", level.regions, "region")
    return root


def _padded(vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, d) with a zero third component in 2D, shape (n, 3)."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
