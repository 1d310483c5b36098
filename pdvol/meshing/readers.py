"""Reads a shape from whatever a scene names: a file of a surface or a volume mesh, or arrays that are passed through.

The library for each format was chosen by trying all of them. OBJ, OFF, STL and PLY are read here: meshio refuses OBJ
files that have more normals or texture coordinates than vertices, trimesh and VTK split vertices along texture seams,
and libigl aborts the process on truncated files; trimesh refuses STL files in capitals, with decimal commas, or with
more bytes than they promise. Files of Gmsh are read by Gmsh, others by meshio or else VTK. What a file really is, is
looked at before (`file_kinds.py`). USD and Alembic are the studio's. Any error of a library becomes a message of one
line. All reading happens in a child process of limited processor time and memory.
"""

import atexit
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.level_mesh import boundary_facets
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.child_process import Child
from pdvol.meshing.cpu_budget import BudgetSpent, ProcessFailed, check_budget
from pdvol.meshing.file_kinds import BYTE_ORDER_MARK, check_kind, converter, no_file
from pdvol.meshing.surface_files import SURFACES, first_that_reads, read_surface
from pdvol.meshing.volume_files import PAIR, SERIES, VOLUMES, VTK_ONLY, read_pair, read_volume
from pdvol.meshing.weld import weld_open
from pdvol.registry import STUDIO
from pdvol.scene.point_caches import ALEMBIC_FILES, USD_FILES

SCENES = USD_FILES + ALEMBIC_FILES
"""Files of scenes, whose meshes are read as one surface."""
LOADS = {**dict.fromkeys(VOLUMES, "meshio"), **dict.fromkeys(VTK_ONLY, "pyvista")}
"""The library that reads a kind of file: its loading does not count as reading."""
MARK_IN_THE_WAY = (".ply", ".off", ".stl", ".msh", ".vtk", ".vtu", ".mesh")  # of a byte-order mark: others skip it
BASE_SECONDS = 6.0  # limit on processor time [s] for a file of no size: leaves time to load a second library
BYTES_PER_SECOND = 1e6  # file size [bytes] that adds one second to that limit: large files take longer to parse
BASE_MEMORY = 1000 * 2**20  # memory limit [bytes] for a file of no size: a library maps 400 MiB
MEMORY_PER_BYTE = 60  # memory [bytes] that each byte of the file adds to the limit: text is read into Python objects

_idle: list[Child] = []
"""Readers that wait for another file: it takes a third of a second to start one, and more to load a library."""


@atexit.register
def _end_idle() -> None:
    while _idle:
        _idle.pop().end()


def read_in_child_process(path: Path, read: Callable, *given: Any, loads: str = "") -> Any:
    """The result of `read(path, *given)`, a function of a module's top level, which runs in a child process.

    It raises InputError as `read` does, and MeshError where `read` crashed, hung, or exceeded the limit on processor
    time or memory for a file of this size.
    """
    size = path.stat().st_size
    seconds, memory = BASE_SECONDS + size / BYTES_PER_SECOND, int(BASE_MEMORY + MEMORY_PER_BYTE * size)
    child = _idle.pop() if _idle else Child()
    if not child.alive:
        child.end()
        child = Child()
    try:
        return child.call("its reader", read, path, *given, cpu_seconds=seconds, memory=memory, loads=loads)
    except BudgetSpent:
        check_budget(str(path))
        raise
    except ProcessFailed as error:
        raise MeshError(f"{path}: unreadable, {error}; export the mesh again") from None
    finally:
        if child.alive:
            _idle.append(child)


def read_shape(shape: str | Path | Outline | Surface | Solid, step: int = 0) -> Outline | Surface | Solid:
    """The shape of `read_with_notes`, without the notes."""
    return read_with_notes(shape, step=step)[0]


def read_with_notes(
    shape: str | Path | Outline | Surface | Solid, weld: bool = True, step: int = 0
) -> tuple[Outline | Surface | Solid, list[str]]:
    """The shape as arrays, and a line for each thing that reading has done to it; arrays are passed through.

    A file of tetrahedra, or a volume-mesh file of triangles that all lie at one z, becomes a `Solid`, other triangles a
    `Surface`. Vertices of an open surface that are exactly the same are welded, unless `weld` is False. Quadratic cells
    are read by their corners. Of a series in an XDMF or PVD file `step` is read: 0 is the first one, -1 the last.

    It raises InputError where the file is missing, of an unknown kind, or of one that has no steps, and MeshError where
    it is unreadable, truncated or empty, or has no such step.
    """
    if isinstance(shape, (Outline, Surface, Solid)):
        return shape, []
    if not isinstance(shape, (str, Path)):
        raise InputError(f"a shape must be a path, an Outline, a Surface or a Solid, not {type(shape).__name__}")
    path = Path(shape).expanduser()
    suffix = path.suffix.lower()
    known = SURFACES + VOLUMES + VTK_ONLY + PAIR + SCENES
    if suffix not in known:
        raise InputError(f"{path}: unknown kind of mesh {suffix!r}; there are {', '.join(known)}{converter(path)}")
    if not path.is_file():
        raise InputError(no_file(path))
    if step and suffix not in SERIES:
        raise InputError(f"{path}: step = {step}, and only files of {', '.join(SERIES)} have steps; leave it out")
    try:
        with path.open("rb") as file:
            start = file.read(len(BYTE_ORDER_MARK))
    except OSError as error:
        raise InputError(f"{path}: cannot be opened ({error.strerror}); check its permissions") from error
    if not start:
        raise MeshError(f"{path}: the file is empty; export the mesh again")
    if start == BYTE_ORDER_MARK and suffix in MARK_IN_THE_WAY:
        with tempfile.TemporaryDirectory(prefix="pdvol-read-") as folder:
            copy = Path(folder) / path.name
            with path.open("rb") as source, copy.open("wb") as target:
                source.seek(len(BYTE_ORDER_MARK))
                shutil.copyfileobj(source, target)
            try:
                read, notes = _read(copy, 0)
            except MeshError as error:
                raise MeshError(str(error).replace(str(copy), str(path))) from None
    else:
        read, notes = _read(path, step)
    check_budget(str(path))
    if weld and isinstance(read, Surface):
        read, welded = weld_open(read)
        notes = notes + welded
    return read, notes


def read_numbered(file: str | Path, whose: str) -> tuple[np.ndarray, np.ndarray]:
    """All vertices (n, d) of a file that a scene names, in the file's order, and the facets (f, d) int64 between them:
    triangles, or edges of a flat volume mesh. Of volume meshes these are the boundary.

    `whose` is the field that names it, as "PointCache.faces". It raises InputError where the file is missing or
    unreadable, has no facets, or does not number its vertices, as STL.
    """
    if Path(file).suffix.lower() == ".stl":
        raise InputError(f"{whose}: {file}: STL files do not number their vertices; export OBJ or PLY")
    try:
        shape = read_with_notes(file, weld=False)[0]
    except InputError as error:
        raise InputError(f"{whose}: {error}") from error
    if isinstance(shape, Solid):
        return shape.vertices, boundary_facets(shape.cells.astype(np.int64))[0]
    vertices, triangles = shape.vertices, shape.triangles.astype(np.int64)
    if triangles.min() < 0 or triangles.max() >= len(vertices):
        raise InputError(f"{whose}: {file}: its faces do not fit its {len(vertices):,} vertices; export it again")
    return vertices, triangles


def _read(path: Path, step: int) -> tuple[Surface | Solid, list[str]]:
    suffix = path.suffix.lower()
    if suffix in SCENES:
        return STUDIO["read_still"](path)
    check_kind(path)
    if suffix in PAIR:
        return read_in_child_process(path, first_that_reads, read_pair)
    if suffix in SURFACES:
        return read_in_child_process(path, read_surface)
    return read_in_child_process(path, read_volume, step, loads=LOADS[suffix])
