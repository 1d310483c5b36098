"""XDMF time series with HDF5 data, for ParaView, Blender's importers and meshio; also of a run that is not finished.

`level_N.xdmf` is XML and names `level_N.h5` beside it, so the two can be moved together. The rest geometry and the
cells' data are stored once and referred to by every step; each step adds its fields. (meshio's own writer puts the HDF5
file into the working directory.)
"""

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import h5py
import numpy as np

from pdvol.errors import InputError
from pdvol.store.files import write_bytes
from pdvol.store.reader import Run
from pdvol.store.series import Fields, LevelFields, Series, nothing_more
from pdvol.studio.export.files import write_script, written_aside
from pdvol.studio.shown import PALETTE, srgb_colour, upward_in_3d

_NUMBER_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}


def export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields) -> list[Path]:
    """Write `out/level_<l>.xdmf`, its `.h5` file, and `out/open_in_paraview.py`. See `pdvol.studio.export`."""
    written = [write_xdmf(run, level, out / f"level_{level}.xdmf", fields(level)) for level in levels]
    names = [str(name) for name in run.info.get("bodies", [])]
    colours = [tuple(round(part, 4) for part in srgb_colour(PALETTE[i % len(PALETTE)])) for i in range(len(names))]
    values = {"LEVELS": sorted(levels), "BODIES": names, "COLOURS": colours, "UP": tuple(upward_in_3d(run).tolist())}
    return [*written, write_script(out, "open_in_paraview", FLAT=run.levels[0].rest.shape[1] == 2, **values)]


def write_xdmf(run: Run, level: int, path: str | Path, more: Fields = nothing_more) -> Path:
    """Export the stored steps of one level; also of a run that is not finished.

    Parameters
    ----------
    run : Run
    level : int
    path : the .xdmf file; its data goes beside it, with the ending .h5
    more : fields beside `displacement`, `velocity`, `body` and `region`

    Returns
    -------
    Path
        The .xdmf file. It and the .h5 file are written aside and renamed: a reader finds a whole export, the earlier
        or the new one.

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
    series = Series(run, level, more)
    data = path.with_suffix(".h5")
    # The data first: an old .xdmf finds its steps in new data, while a new one would miss some in the old.
    with written_aside(data, series.size) as aside, h5py.File(aside, "w") as file:
        xml = _write_data(file, data.name, series)
    ET.indent(xml)
    write_bytes(path, b'<?xml version="1.0"?>\n' + ET.tostring(xml) + b"\n")
    return path


def _write_data(file: h5py.File, name: str, series: Series) -> ET.Element:
    """Fill the HDF5 file step by step (only one is ever in memory) and return the XML that describes it."""

    def item(parent: ET.Element, key: str, array: np.ndarray) -> None:
        """Refers to an array, and writes it the first time."""
        if key not in written:  # to ask the file takes as long as to write a small array
            file[key] = array
            written.add(key)
        shape, kind, precision = " ".join(map(str, array.shape)), array.dtype.kind, str(array.dtype.itemsize)
        ET.SubElement(
            parent, "DataItem", Dimensions=shape, NumberType=_NUMBER_TYPES[kind], Precision=precision, Format="HDF"
        ).text = f"{name}:/{key}"

    def attribute(grid: ET.Element, key: str, centre: str, array: np.ndarray) -> None:
        rank, label = "Vector" if array.ndim == 2 else "Scalar", key.rpartition("/")[2]
        item(ET.SubElement(grid, "Attribute", Name=label, AttributeType=rank, Center=centre), key, array)

    written: set[str] = set()
    rest, cells = series.level.rest, series.level.cells
    root = ET.Element("Xdmf", Version="3.0")
    domain = ET.SubElement(root, "Domain")
    collection = ET.SubElement(
        domain, "Grid", Name=f"level {series.level.index}", GridType="Collection", CollectionType="Temporal"
    )
    shape, geometry = ("Triangle", "XY") if rest.shape[1] == 2 else ("Tetrahedron", "XYZ")
    for step in range(series.steps):
        fields = series.fields(step)
        grid = ET.SubElement(collection, "Grid", Name=f"step {step}", GridType="Uniform")
        # Every step names the shared mesh itself: readers without XInclude understand it too.
        topology = ET.SubElement(grid, "Topology", TopologyType=shape, NumberOfElements=str(len(cells)))
        item(topology, "mesh/cells", cells)
        item(ET.SubElement(grid, "Geometry", GeometryType=geometry), "mesh/points", rest)
        ET.SubElement(grid, "Time", Value=repr(step * series.dt))
        for centre, arrays in (("Node", fields.points), ("Cell", fields.cells)):
            for label, values in sorted(arrays.items()):
                attribute(grid, f"steps/{step}/{centre}/{label}", centre, values)
        for label, values in series.labels.items():
            attribute(grid, f"mesh/{label}", "Cell", values)
    return root
