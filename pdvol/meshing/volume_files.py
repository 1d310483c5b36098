"""Meshes of tetrahedra, and of triangles, from the files of mesh generators: read in a child process (`readers.py`)."""

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pdvol.errors import MeshError
from pdvol.geometry.level_mesh import simplex_volumes
from pdvol.meshes import Solid, Surface
from pdvol.meshing.gmsh_files import in_one_group, read_gmsh
from pdvol.meshing.losses import lost_labels, unread_labels
from pdvol.meshing.surface_files import CORNERS, first_that_reads, indices, triangles_of
from pdvol.meshing.weld import open_edges
from pdvol.meshing.xdmf_files import check_step, first_of, read_xdmf, welded

if TYPE_CHECKING:
    import meshio

VOLUMES = (".msh", ".vtk", ".vtu", ".mesh", ".xdmf")
VTK_ONLY = (".vtp", ".pvtu", ".pvd", ".vtm", ".vtkhdf")
"""Further files that VTK reads: surfaces, and collections of other files."""
SERIES = (".xdmf", ".pvd")
"""Files that may hold a mesh for each of several steps."""
PAIR = (".node", ".ele")
"""NAME.node and NAME.ele, as TetGen and Triangle write them, in text."""
_LABELS = (
    *("gmsh:physical", "medit:ref", "material", "MaterialIDs", "regions", "region", "cell_tags", "mesh_tags"),
    *("name_to_read", "gmsh:geometrical"),
)
"""Names under which cells carry their region, the most explicit first."""


def read_volume(path: Path, step: int = 0) -> tuple[Solid | Surface, list[str]]:
    """The mesh of a file of `VOLUMES` or `VTK_ONLY`, and notes: a `Solid` of its tetrahedra, or of triangles that all
    lie at one z; a `Surface` of other triangles. Of a file of `SERIES` at a `step`. It raises MeshError where the file
    is unreadable, holds neither tetrahedra nor triangles, or other solids, or has no such step.
    """
    suffix = path.suffix.lower()
    others: tuple[Callable[[Path], meshio.Mesh], ...] = _with_meshio, _with_vtk
    if suffix in VTK_ONLY:
        others = (partial(_with_vtk, step=step),)
    elif suffix == ".xdmf":
        others = (partial(read_xdmf, step=step),)
    elif suffix in (".msh", ".mesh"):
        others = (read_gmsh, _with_meshio)[suffix == ".mesh" :]
    mesh = first_that_reads(path, *others)
    points = np.asarray(mesh.points, dtype=np.float64)
    unoriented = suffix == ".xdmf" or any(block.type.startswith("VTK_LAGRANGE") for block in mesh.cells)
    notes = [*mesh.info] if isinstance(mesh.info, list) else []
    notes += _quadratic(_cut_to_corners(mesh))
    solids = sum(len(block.data) for block in mesh.cells if block.dim == 3 and block.type != "tetra")
    if solids:  # a body without them would have holes
        raise MeshError(f"{path}: {solids:,} of its cells are solids but no tetrahedra; export tetrahedra alone")
    tets = [b for b, block in enumerate(mesh.cells) if block.type == "tetra" and len(block.data)]
    if tets:
        cells = np.concatenate([np.asarray(mesh.cells[b].data) for b in tets])
        blocks, rows = np.concatenate([np.full(len(mesh.cells[b].data), b) for b in tets]), None
    else:
        cells, blocks, rows = triangles_of(mesh)
    if len(cells) == 0:
        kinds = ", ".join(sorted({block.type for block in mesh.cells})) or "nothing"
        raise MeshError(f"{path}: holds no tetrahedra and no triangles (only {kinds}); export one of the two")
    cells = indices(path, cells)
    inside = cells.min() >= 0 and cells.max() < len(points)
    labels = _regions(mesh, blocks, rows)
    if not tets and points.shape[1] == 3 and not (inside and np.ptp(points[cells, 2]) == 0.0):
        names = [str(label) for label in np.unique(labels)]
        if suffix == ".msh" and labels.any() and len(open_edges(cells)):
            notes.append("Gmsh saves only what is in physical groups: give the volume one, or set Mesh.SaveAll=1")
        if inside and np.ptp(points[cells.ravel()], axis=0).min() == 0.0:
            notes.append("all of it lies at one x or y; for a scene in 2D turn it, so that it lies at one z")
        return Surface(points, cells), notes + lost_labels(names if len(names) > 1 else [])
    points = points if tets else np.ascontiguousarray(points[:, :2])
    if suffix == ".msh":
        cells, labels, found = in_one_group(cells, labels)
        notes += found
    if unoriented and inside:  # the order of a cell's nodes means nothing to FEniCS
        turned = simplex_volumes(points, cells) < 0.0
        cells[turned] = cells[turned][:, [1, 0, *range(2, cells.shape[1])]]
    return Solid(points, cells, labels), notes + unread_labels(mesh.cell_data, _LABELS)


def _quadratic(count: int) -> list[str]:
    return [f"{count:,} quadratic cells are read by their corners"] if count else []


def _cut_to_corners(mesh: "meshio.Mesh") -> int:
    """Turn the cells of `CORNERS` into linear ones, and count those that had more nodes."""
    from meshio import CellBlock

    count = 0
    for b, block in enumerate(mesh.cells):
        name = block.type.lower().removeprefix("vtk_lagrange_")
        kind = next((kind for kind in CORNERS if name.startswith(kind)), "")
        if kind:
            data = np.asarray(block.data)
            count += len(data) if data.shape[1] > CORNERS[kind] else 0
            mesh.cells[b] = CellBlock(kind, data[:, : CORNERS[kind]])
    return count


def _regions(mesh: "meshio.Mesh", blocks: np.ndarray, rows: np.ndarray | None) -> np.ndarray:
    """Labels (m,) int32 of cells that come from `rows` (in order where None) of `blocks`."""
    labels = np.zeros(len(blocks), dtype=np.int32)
    for name in (name for name in _LABELS if name in mesh.cell_data):
        for b in np.unique(blocks):
            values, mine = np.asarray(mesh.cell_data[name][b]), blocks == b
            if values.ndim == 1 and np.isfinite(values).all():
                labels[mine] = np.round(values[: mine.sum()] if rows is None else values[rows[mine]]).astype(np.int32)
        if labels.any():  # Gmsh gives cells without a physical group the number 0
            break
    return labels


def _with_meshio(path: Path) -> "meshio.Mesh":
    """A VTU file whose counts do not fit its arrays is not left to VTK, which would drop what is too much."""
    import meshio

    def refuse(message: str) -> None:
        raise meshio.ReadError(message)

    meshio._vtk_common.warn = refuse  # it would leave out cells of types that it does not know
    try:
        return (meshio.vtu.read if path.suffix.lower() == ".vtu" else meshio.read)(path)
    except (ValueError, meshio.ReadError) as error:
        # of points, of cells
        if path.suffix.lower() == ".vtu" and (str(error).startswith("cannot reshape array") or not str(error)):
            raise MeshError(
                f"{path}: unreadable, the counts of points and cells do not fit the arrays; export the mesh again"
            ) from error
        raise


def _with_vtk(path: Path, step: int = 0) -> "meshio.Mesh":
    """Of a time series the given step. Pieces are joined where their points are exactly the same."""
    import pyvista

    others = re.findall(r"\b(?:Source|file)=\"([^\"]+)", path.read_text(errors="replace")) if _collects(path) else []
    missing = next((other for other in others if not (path.parent / other).is_file()), "")
    if missing:
        raise MeshError(f"{path}: there is no {missing} beside it, with its data; keep the files together")
    reader = pyvista.get_reader(path)
    times = sorted(set(reader.time_values)) if path.suffix.lower() == ".pvd" else []
    if times:
        check_step(path, step, len(times))
        reader.set_active_time_value(times[step])
    found, notes = reader.read(), first_of(len(times), step)
    grid = found.combine() if isinstance(found, pyvista.MultiBlock) else found.cast_to_unstructured_grid()
    strips = grid.celltypes == pyvista.CellType.TRIANGLE_STRIP
    if strips.any():
        others = grid.extract_cells(~strips)
        solid = any(block.dim == 3 for block in pyvista.to_meshio(others).cells)
        grid = others if solid else grid.extract_geometry().triangulate()
    mesh = pyvista.to_meshio(grid)
    mesh.info = notes
    return welded(mesh) if _collects(path) else mesh


def _collects(path: Path) -> bool:
    """Whether the data are in other files."""
    return path.suffix.lower() in (".pvtu", ".pvd", ".vtm")


def read_pair(path: Path) -> tuple[Solid, list[str]]:
    """The mesh of a pair of files, of which either is named, and notes; cells by their corners. It raises MeshError
    where the other file is missing, or a file does not hold what it promises.
    """
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
