"""Reads a shape from whatever a scene names: a file of a surface or a volume mesh, or arrays that are passed through.

The library for each format was chosen by trying all of them. OBJ is read here: meshio refuses files that have more
normals or texture coordinates than vertices, trimesh and VTK split vertices along texture seams, and libigl aborts the
process on truncated files. PLY, OFF and STL are read by trimesh, because meshio never returns from a PLY or OFF with a
truncated header. What a file really is, is looked at before (`file_kinds.py`). Any error of a library becomes a message
of one line. All reading happens in a child process of limited processor time and memory (`reader_process.py`).
"""

import contextlib
import io
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.cpu_budget import check_budget
from pdvol.meshing.file_kinds import BYTE_ORDER_MARK, check_kind, converter
from pdvol.meshing.mesher_process import run_worker
from pdvol.meshing.reader_process import BASE_SECONDS, BYTES_PER_SECOND, read_in_child_process
from pdvol.meshing.surface_files import QUADRATIC, read_obj, read_off, triangles_of, with_trimesh
from pdvol.meshing.tetgen_files import PAIR, node_and_ele
from pdvol.meshing.weld import weld_open

if TYPE_CHECKING:
    import meshio

TETRAHEDRA = ("tetra", "tetra10")
"""meshio's names of the solid cells that are read."""

SURFACES = (".obj", ".ply", ".off", ".stl")
VOLUMES = (".msh", ".vtk", ".vtu", ".mesh", ".xdmf")
MARK_IN_THE_WAY = (".ply", ".off", ".stl", ".msh", ".vtk", ".vtu", ".mesh")  # of a byte-order mark: others skip it
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

Result = TypeVar("Result")


def read_shape(shape: str | Path | Outline | Surface | Solid) -> Outline | Surface | Solid:
    """The shape as arrays; arrays are passed through.

    See `read_with_notes`, which also says what was done to it.
    """
    return read_with_notes(shape)[0]


def read_with_notes(shape: str | Path | Outline | Surface | Solid) -> tuple[Outline | Surface | Solid, list[str]]:
    """The shape as arrays, and a line for each thing that reading has done to it; arrays are passed through.

    A file of tetrahedra, or a volume-mesh file of triangles that all lie at one z, becomes a `Solid`, other triangles a
    `Surface`. Vertices of an open surface that are exactly the same are welded. Quadratic cells are read by their
    corners.

    Raises
    ------
    InputError
        The file is missing or of an unknown kind.
    MeshError
        It is unreadable, truncated or empty.
    """
    if isinstance(shape, (Outline, Surface, Solid)):
        return shape, []
    if not isinstance(shape, (str, Path)):
        raise InputError(f"a shape must be a path, an Outline, a Surface or a Solid, not {type(shape).__name__}")
    path = Path(shape).expanduser()
    suffix = path.suffix.lower()
    if suffix not in SURFACES + VOLUMES + PAIR:
        known = ", ".join(SURFACES + VOLUMES + PAIR)
        raise InputError(f"{path}: unknown kind of mesh {suffix!r}; there are {known}{converter(path)}")
    if not path.is_file():
        raise InputError(f"{path}: there is no such file; check the path (the working folder is {Path.cwd()})")
    try:
        with path.open("rb") as file:
            start = file.read(len(BYTE_ORDER_MARK))
    except OSError as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror}); check its permissions") from error
    if not start:
        raise MeshError(f"{path}: the file is empty; export the mesh again")
    if suffix not in (
        ".obj",
        *PAIR,
    ):  # before the child is forked: its limits on time and memory are for the file alone
        import_module("trimesh" if suffix in SURFACES else "meshio")
    reader = _surface if suffix in SURFACES else _pair if suffix in PAIR else _volume
    if start == BYTE_ORDER_MARK and suffix in MARK_IN_THE_WAY:
        read = _read_without_mark(path, reader)
    else:
        check_kind(path)
        read = read_in_child_process(path, reader)
    check_budget(str(path))
    points = np.ascontiguousarray(read["points"], dtype=np.float64)
    notes = [str(note) for note in read.get("notes", ())]
    if "triangles" in read:
        surface, welded = weld_open(Surface(points, _indices(path, read["triangles"])))
        return surface, notes + welded
    return Solid(points, _indices(path, read["cells"]), read["regions"].astype(np.int32)), notes


def _read_without_mark(path: Path, reader: Callable[[Path], dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """A file that begins with a byte-order mark, by a copy of the rest."""
    with tempfile.TemporaryDirectory(prefix="pdvol-read-") as folder:
        copy = Path(folder) / path.name
        with path.open("rb") as source, copy.open("wb") as target:
            source.seek(len(BYTE_ORDER_MARK))
            shutil.copyfileobj(source, target)
        try:
            check_kind(copy)
            return read_in_child_process(copy, reader)
        except MeshError as error:
            raise MeshError(str(error).replace(str(copy), str(path))) from None


def _indices(path: Path, cells: np.ndarray) -> np.ndarray:
    """The cells as int32, after a check that all indices fit: numpy would wrap larger ones silently."""
    if cells.size and (cells.min() < -(2**31) or cells.max() >= 2**31):
        raise MeshError(f"{path}: cells use vertices beyond number {2**31 - 1:,}; export the mesh again")
    return np.ascontiguousarray(cells, dtype=np.int32)


def _attempts(path: Path, readers: Sequence[Callable[[Path], Result]]) -> Result:
    """The result of the first of `readers` that succeeds; if all fail, the error states the first reason."""
    reasons = []
    for reader in readers:
        try:
            with suppressed_output():
                return reader(path)
        except MemoryError:
            raise
        # The libraries raise whatever they like, and meshio calls sys.exit.
        except (Exception, SystemExit) as error:
            if isinstance(error, MeshError) and str(error).startswith(str(path)):  # what is wrong is known
                raise
            reasons.append(" ".join(str(error).split()) if not isinstance(error, SystemExit) else "")
    reason = next((r for r in reasons if r), "its contents do not fit its extension")
    raise MeshError(f"{path}: unreadable or truncated ({reason[:160]}); export the mesh again")


# ---- surfaces


def _surface(path: Path) -> dict[str, np.ndarray]:
    readers = {".obj": (read_obj,), ".off": (with_trimesh, read_off)}.get(path.suffix.lower(), (with_trimesh,))
    points, triangles = _attempts(path, readers)
    if len(triangles) == 0:
        raise MeshError(f"{path}: holds no triangles; export a triangle surface")
    return {"points": np.asarray(points, dtype=np.float64), "triangles": np.asarray(triangles)}


# ---- volume meshes


def _volume(path: Path) -> dict[str, np.ndarray]:
    readers = [_with_meshio]
    if path.suffix.lower() == ".msh":
        readers.append(_with_meshio_known_sections)
    if path.suffix.lower() in (".vtk", ".vtu"):
        readers.append(_with_vtk)
    mesh = _attempts(path, readers)
    points = np.asarray(mesh.points, dtype=np.float64)
    others = [block for block in mesh.cells if block.dim == 3 and block.type not in TETRAHEDRA and len(block.data)]
    if others:
        _refuse_others(path, sum(len(block.data) for block in others))
    curved = sum(len(block.data) for block in mesh.cells if block.type in QUADRATIC)
    notes = np.array([f"{curved:,} quadratic cells are read by their corners"] if curved else [], dtype=str)
    tets = [b for b, block in enumerate(mesh.cells) if block.type in TETRAHEDRA and len(block.data)]
    if tets:
        cells = np.concatenate([np.asarray(mesh.cells[b].data)[:, :4] for b in tets])
        labels = _regions(mesh, np.concatenate([np.full(len(mesh.cells[b].data), b) for b in tets]), None)
        return {"points": points, "cells": cells, "regions": labels, "notes": notes}
    triangles, blocks, rows = triangles_of(mesh)
    if len(triangles) == 0:
        kinds = sorted({block.type for block in mesh.cells})
        raise MeshError(
            f"{path}: holds no tetrahedra and no triangles (only {', '.join(kinds) or 'nothing'}); export one of"
            " the two"
        )
    if points.shape[1] == 2 or np.ptp(points[triangles, 2]) == 0.0:
        return {"points": points[:, :2], "cells": triangles, "regions": _regions(mesh, blocks, rows), "notes": notes}
    return {"points": points, "triangles": triangles, "notes": notes}


def _refuse_others(path: Path, count: int) -> NoReturn:
    """A body without the cells that are no tetrahedra would have holes."""
    raise MeshError(f"{path}: {count:,} of its cells are solids but no tetrahedra; export tetrahedra alone")


def _pair(path: Path) -> dict[str, np.ndarray]:
    return _attempts(path, (node_and_ele,))


def _regions(mesh: "meshio.Mesh", blocks: np.ndarray, rows: np.ndarray | None) -> np.ndarray:
    """Labels (m,) int32 of cells that come from `rows` (in order where None) of `blocks`."""
    labels = np.zeros(len(blocks), dtype=np.int32)
    for name in _LABELS:
        if name not in mesh.cell_data:
            continue
        for b in np.unique(blocks):
            values = np.asarray(mesh.cell_data[name][b])
            mine = blocks == b
            if values.ndim == 1 and np.isfinite(values).all():
                labels[mine] = np.round(values[: mine.sum()] if rows is None else values[rows[mine]]).astype(np.int32)
        break
    return labels


def _with_meshio(path: Path) -> "meshio.Mesh":
    import meshio

    if path.suffix.lower() == ".vtu":
        return _vtu_with_meshio(path)
    return meshio.read(path)


def _vtu_with_meshio(path: Path) -> "meshio.Mesh":
    """A VTU file; one whose counts do not fit its arrays is not left to VTK, which would drop what is too much."""
    import meshio

    try:
        return meshio.vtu.read(path)
    except (ValueError, meshio.ReadError) as error:
        if str(error).startswith("cannot reshape array") or not str(error):  # of points, of cells
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
                if (
                    not skipped
                    and word.startswith(b"$")
                    and word[1:].decode("ascii", "replace").removeprefix("End") not in _MSH_SECTIONS
                ):
                    skipped = b"$End" + word[1:]
                if not skipped:
                    target.write(line)
                if word == skipped:
                    skipped = b""
            shutil.copystat(path, copy)
        return meshio.read(copy)


def _with_vtk(path: Path) -> "meshio.Mesh":
    """Legacy and XML VTK files, read by VTK in a process of its own: VTK ends the process on some truncated files."""
    import meshio

    read = run_worker(
        "vtk_worker.py", BASE_SECONDS + path.stat().st_size / BYTES_PER_SECOND, path=np.array(str(path.resolve()))
    )
    if read["others"]:
        _refuse_others(path, int(read["others"]))
    labels = {name.removeprefix("label "): values for name, values in read.items() if name.startswith("label ")}
    blocks = [(kind, read[kind]) for kind in ("tetra", "tetra10", "triangle") if len(read[kind])]
    starts = {"tetra": 0, "tetra10": len(read["tetra"]), "triangle": len(read["tetra"]) + len(read["tetra10"])}
    data = {
        name: [values[starts[kind] : starts[kind] + len(cells)] for kind, cells in blocks]
        for name, values in labels.items()
    }
    return meshio.Mesh(read["points"], blocks, cell_data=data)


@contextlib.contextmanager
def suppressed_output() -> Iterator[None]:
    """Discards all that is written to standard output and standard error within the `with` block."""
    sys.stdout.flush()
    sys.stderr.flush()
    saved = [(fd, os.dup(fd)) for fd in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for fd, _ in saved:
            os.dup2(nowhere, fd)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        for fd, copy in saved:
            os.dup2(copy, fd)
            os.close(copy)
        os.close(nowhere)
