"""Meshes from XDMF files, also of dolfinx and of time series: meshio reads their parts."""

from copy import deepcopy
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree.ElementTree import Element, SubElement, parse

import numpy as np

from pdvol.errors import MeshError
from pdvol.meshing.weld import coincident

if TYPE_CHECKING:
    import meshio


def check_step(path: Path, step: int, count: int) -> None:
    """Raise MeshError where a file has no such step."""
    if not -count <= step < count:
        raise MeshError(f"{path}: there is no step {step}; it has {count:,}, numbered from 0")


def first_of(count: int, step: int) -> list[str]:
    """A line on steps of a file where the first one is read."""
    return [f"the first of its {count} steps is read"] if count > 1 and step == 0 else []


def read_xdmf(path: Path, step: int = 0) -> "meshio.Mesh":
    """The first grid with points and cells, or all that lie beside it in a collection: of a time series the given step.
    Mesh tags of dolfinx, which are grids that use the points of another one, become the cell data `mesh_tags`. It
    raises MeshError where the file with the data, or the step, is missing.
    """
    root = parse(path).getroot()
    steps = next(filter(None, map(_steps, root.findall("Domain/Grid"))), None)
    if steps is None:
        raise ValueError("no grid has points and cells")
    check_step(path, step, len(steps))
    whole = steps[step]
    mesh = _joined([_read_grid(path, piece, piece) for piece in whole])
    series = [len(one.findall("Grid")) for one in root.iter("Grid") if one.get("CollectionType") == "Temporal"]
    mesh.info = first_of(max(series, default=0), step)
    for grid in root.findall("Domain/Grid"):
        if grid.find("Geometry") is None and None not in map(grid.find, ("Topology", "Attribute")):
            tags = _read_grid(path, grid, whole[0])
            if [block.type for block in tags.cells] == [block.type for block in mesh.cells] and len(mesh.cells) == 1:
                count = len(mesh.cells[0].data)
                rows = np.sort(np.vstack([mesh.cells[0].data, tags.cells[0].data]), axis=1)
                _, which = np.unique(rows, axis=0, return_inverse=True)
                values = np.zeros(which.max() + 1)
                values[which.ravel()[count:]] = next(iter(tags.cell_data.values()))[0].ravel()
                mesh.cell_data["mesh_tags"] = [values[which.ravel()[:count]]]
    return mesh


def _steps(grid: Element) -> list[list[Element]]:
    """The grids with points and cells that a grid consists of, at each of its steps that has some."""
    if None not in map(grid.find, ("Topology", "Geometry")):
        return [[grid]]
    found = [steps for steps in map(_steps, grid.findall("Grid")) if steps]
    if grid.get("CollectionType") == "Temporal":
        return [steps[0] for steps in found]
    return [sum(pieces, []) for pieces in zip(*found, strict=False)]


def welded(mesh: "meshio.Mesh") -> "meshio.Mesh":
    """The mesh with the cells of points that are exactly the same on the first of these."""
    first = coincident(np.asarray(mesh.points), 0.0)
    for block in mesh.cells:
        block.data = first[block.data]
    return mesh


def _joined(meshes: list["meshio.Mesh"]) -> "meshio.Mesh":
    """Some meshes as one, joined where their points are exactly the same; cell data that one lacks are zero there."""
    if len(meshes) == 1:
        return meshes[0]
    from meshio import Mesh

    ends = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    cells = [(block.type, block.data + end) for mesh, end in zip(meshes, ends, strict=False) for block in mesh.cells]
    data: dict[str, list] = {name: [] for mesh in meshes for name in mesh.cell_data}
    for name, mesh in ((name, mesh) for name in data for mesh in meshes):
        data[name] += mesh.cell_data.get(name) or [np.zeros(len(block.data), dtype=int) for block in mesh.cells]
    return welded(Mesh(np.concatenate([mesh.points for mesh in meshes]), cells, cell_data=data))


def _read_grid(path: Path, grid: Element, whole: Element) -> "meshio.Mesh":
    """Points of `whole`, cells and cell data of `grid`."""
    from meshio.xdmf.common import xdmf_to_meshio_type
    from meshio.xdmf.main import XdmfReader

    parts = [*grid.findall("Topology"), *whole.findall("Geometry")]
    parts += [one for one in grid.findall("Attribute") if one.get("Center") == "Cell"]
    alone = Element("Xdmf")
    SubElement(SubElement(alone, "Domain"), "Grid").extend(deepcopy(parts))
    kinds = {kind.lower(): kind for kind in (*xdmf_to_meshio_type, "Mixed")}
    for topology in alone.iter("Topology"):
        kind = topology.attrib.pop("Type", "") or topology.get("TopologyType", "")
        if kind.lower() not in kinds:
            raise ValueError(f"cells of the type {kind!r} are not read")
        topology.set("TopologyType", kinds[kind.lower()])
    for item in alone.iter("DataItem"):
        if "Reference" in item.attrib:
            raise ValueError("data items that refer to others are not read")
        item.attrib.setdefault("Format", "XML")
        other = (item.text or "").strip().split(":")[0]
        if item.get("Format") == "HDF" and not (path.parent / other).is_file():
            raise MeshError(f"{path}: there is no {other} beside it, with its data; keep the two together")
    return XdmfReader(path).read_xdmf3(alone)
