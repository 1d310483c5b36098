"""Meshes of tetrahedra, and of triangles, from the files of mesh generators: read in a child process (`readers.py`)."""

import re
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pdvol.errors import MeshError
from pdvol.meshes import Solid, Surface
from pdvol.meshing.losses import lost_labels, unread_labels
from pdvol.meshing.surface_files import QUADRATIC, first_that_reads, indices, triangles_of

if TYPE_CHECKING:
    import meshio

TETRAHEDRA = ("tetra", "tetra10")
"""meshio's names of the solid cells that are read."""
VOLUMES = (".msh", ".vtk", ".vtu", ".mesh", ".xdmf")
PAIR = (".node", ".ele")
"""NAME.node and NAME.ele, as TetGen and Triangle write them, in text."""
_MSH_SECTIONS = {"MeshFormat", "PhysicalNames", "Entities", "PartitionedEntities", "Nodes", "Elements"}
_LABELS = (
    "gmsh:physical",
    "medit:ref",
    "material",
    "MaterialIDs",
    "regions",
    "region",
    "cell_tags",
    "gmsh:geometrical",
)
"""Names under which cells carry their region, the most explicit first."""


def read_volume(path: Path) -> tuple[Solid | Surface, list[str]]:
    """The mesh of a file of `VOLUMES`, and notes: a `Solid` of its tetrahedra, or of triangles that all lie at one z; a
    `Surface` of other triangles.

    Raises
    ------
    MeshError
        It is unreadable, or holds neither tetrahedra nor triangles, or other solids.
    """
    suffix = path.suffix.lower()
    others = {".msh": (_with_meshio_known_sections,), ".vtk": (_with_vtk,), ".vtu": (_with_vtk,)}.get(suffix, ())
    mesh = first_that_reads(path, _with_meshio, *others)
    points = np.asarray(mesh.points, dtype=np.float64)
    solids = sum(len(block.data) for block in mesh.cells if block.dim == 3 and block.type not in TETRAHEDRA)
    if solids:  # a body without them would have holes
        raise MeshError(f"{path}: {solids:,} of its cells are solids but no tetrahedra; export tetrahedra alone")
    notes = _quadratic(sum(len(block.data) for block in mesh.cells if block.type in QUADRATIC))
    tets = [b for b, block in enumerate(mesh.cells) if block.type in TETRAHEDRA and len(block.data)]
    if tets:
        cells = np.concatenate([np.asarray(mesh.cells[b].data)[:, :4] for b in tets])
        labels = _regions(mesh, np.concatenate([np.full(len(mesh.cells[b].data), b) for b in tets]), None)
        return Solid(points, indices(path, cells), labels), notes + unread_labels(mesh.cell_data, _LABELS)
    triangles, blocks, rows = triangles_of(mesh)
    if len(triangles) == 0:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "nothing"
        raise MeshError(f"{path}: holds no tetrahedra and no triangles (only {kinds}); export one of the two")
    triangles = indices(path, triangles)
    if points.shape[1] == 2 or np.ptp(points[triangles, 2]) == 0.0:
        return Solid(
            np.ascontiguousarray(points[:, :2]), triangles, _regions(mesh, blocks, rows)
        ), notes + unread_labels(mesh.cell_data, _LABELS)
    labels = np.unique(_regions(mesh, blocks, rows)).tolist()
    return Surface(points, triangles), notes + lost_labels(list(map(str, labels if len(labels) > 1 else [])))


def _quadratic(count: int) -> list[str]:
    return [f"{count:,} quadratic cells are read by their corners"] if count else []


def _regions(mesh: "meshio.Mesh", blocks: np.ndarray, rows: np.ndarray | None) -> np.ndarray:
    """Labels (m,) int32 of cells that come from `rows` (in order where None) of `blocks`."""
    labels = np.zeros(len(blocks), dtype=np.int32)
    name = next((name for name in _LABELS if name in mesh.cell_data), None)
    for b in np.unique(blocks) if name else ():
        values, mine = np.asarray(mesh.cell_data[name][b]), blocks == b
        if values.ndim == 1 and np.isfinite(values).all():
            labels[mine] = np.round(values[: mine.sum()] if rows is None else values[rows[mine]]).astype(np.int32)
    return labels


def _with_meshio(path: Path) -> "meshio.Mesh":
    """A VTU file whose counts do not fit its arrays is not left to VTK, which would drop what is too much."""
    import meshio

    try:
        return (meshio.vtu.read if path.suffix.lower() == ".vtu" else meshio.read)(path)
    except (ValueError, meshio.ReadError) as error:
        # of points, of cells
        if path.suffix.lower() == ".vtu" and (str(error).startswith("cannot reshape array") or not str(error)):
            raise MeshError(
                f"{path}: unreadable, the counts of points and cells do not fit the arrays; export the mesh again"
            ) from error
        raise


def _with_meshio_known_sections(path: Path) -> "meshio.Mesh":
    """A .msh without the sections that only its author knows."""
    import meshio

    with tempfile.TemporaryDirectory(prefix="pdvol-read-") as folder:
        copy = Path(folder) / path.name
        with path.open("rb") as source, copy.open("wb") as target:
            skipped = b""
            for line in source:
                word = line.strip()
                name = word[1:].decode("ascii", "replace").removeprefix("End")
                if not skipped and word.startswith(b"$") and name not in _MSH_SECTIONS:
                    skipped = b"$End" + word[1:]
                if not skipped:
                    target.write(line)
                if word == skipped:
                    skipped = b""
            shutil.copystat(path, copy)
        return meshio.read(copy)


def _with_vtk(path: Path) -> "meshio.Mesh":
    import pyvista

    return pyvista.to_meshio(pyvista.read(path))


def read_pair(path: Path) -> tuple[Solid, list[str]]:
    """The mesh of a pair of files, of which either is named, and notes; cells by their corners.

    Raises
    ------
    MeshError
        The other file is missing, or a file does not hold what it promises.
    """
    return first_that_reads(path, _node_and_ele)


def _node_and_ele(path: Path) -> tuple[Solid, list[str]]:
    nodes, elements = (path.with_suffix(suffix) for suffix in PAIR)
    for file in (nodes, elements):
        if not file.is_file():
            raise MeshError(f"{path}: there is no {file.name} beside it; .node and .ele files are exported as a pair")
    (_, dim, *_), points = _table(nodes, path)
    (_, width, *_), cells = _table(elements, path)
    if dim not in (2, 3):
        raise MeshError(f"{path}: {nodes.name} has points of {dim} coordinates; export the mesh again")
    if width not in {2: (3, 6), 3: (4, 10)}[dim]:
        raise MeshError(f"{path}: {elements.name} has cells of {width} nodes; export triangles or tetrahedra")
    labels = cells[:, 1 + width] if cells.shape[1] > 1 + width else np.zeros(len(cells))
    corners = cells[:, 1 : 2 + dim].astype(np.int64) - int(points[0, 0])  # vertices are numbered from 0 or 1 on
    solid = Solid(points[:, 1 : 1 + dim].copy(), indices(path, corners), np.round(labels).astype(np.int32))
    return solid, _quadratic(len(cells) if width in (6, 10) else 0)


def _table(file: Path, path: Path) -> tuple[list[int], np.ndarray]:
    """The four counts of a file's first line, missing ones 0: rows, and numbers behind a row's first; and the rows."""
    text = re.sub(r"#[^\n]*", "", file.read_text(encoding="utf-8-sig", errors="replace")).lstrip()
    first, _, rest = text.partition("\n")
    header = ([int(word) for word in first.split()[:4]] + [0] * 4)[:4]
    if min(header) < 0 or header[0] == 0:
        raise MeshError(f"{path}: unreadable, {file.name} promises {min(header)} of something; export the mesh again")
    numbers, width = np.array(rest.split(), dtype=float), 1 + sum(header[1:])
    if len(numbers) < header[0] * width:
        raise MeshError(
            f"{path}: truncated, {file.name} promises {header[0]:,} rows and holds {len(numbers) // width:,};"
            " export the mesh again"
        )
    return header, numbers[: header[0] * width].reshape(-1, width)
