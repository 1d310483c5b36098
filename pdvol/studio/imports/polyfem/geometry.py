"""Meshes of a PolyFEM scene: read, normalised, transformed and refined in PolyFEM's order."""

import re
from dataclasses import dataclass
from glob import glob
from itertools import product
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pdvol.errors import InputError
from pdvol.geometry.halved_cells import halved, oriented
from pdvol.geometry.level_mesh import boundary_facets, simplex_centres
from pdvol.meshes import Solid, Surface
from pdvol.meshing.readers import read_shape
from pdvol.scene import PointCache
from pdvol.studio.imports.polyfem.document import Section, is_a
from pdvol.studio.imports.polyfem.selections import UNSELECTED, Selection, numbers_at, read_selections

MOST_REFINEMENTS = 6  # uniform refinements of a mesh: more are a typing error
MOST_COPIES = 1000  # meshes of an array: more are a typing error


@dataclass(frozen=True)
class Meshed:
    """A deformable geometry.

    Attributes
    ----------
    name : of the body
    path : in the JSON
    levels : a `Solid` each, whose regions are volume numbers
    surface : the selections of its facets, where the first of an array stands
    offset : (d,) [m] from there
    """

    name: str
    path: str
    levels: tuple[Solid, ...]
    surface: tuple[Selection, ...]
    offset: np.ndarray

    @property
    def numbers(self) -> tuple[int, ...]:
        """The volume numbers of its cells, ascending."""
        return tuple(np.unique(self.levels[0].regions).tolist())

    def selected(self, wanted: set[int] | None) -> np.ndarray:
        """(n, d) the vertices, of all levels, of boundary facets with one of these numbers; of all facets for None."""
        found = []
        for solid in self.levels:
            facets, _ = boundary_facets(solid.cells.astype(np.int64))
            centres = solid.vertices[facets].mean(axis=1) - self.offset
            numbers = numbers_at(list(self.surface), centres, np.full(len(facets), UNSELECTED))
            chosen = np.ones(len(facets), dtype=bool) if wanted is None else np.isin(numbers, list(wanted))
            found.append(solid.vertices[np.unique(facets[chosen])])
        return np.unique(np.concatenate(found), axis=0)


def read_bodies(entry: Section, folder: Path, name: str, levels: int) -> list[Meshed]:
    """A deformable mesh, or all of an array of it; none where something of it was refused."""
    shape, path = _shape(entry, folder, entry.get("mesh"), "mesh"), entry.at("mesh")
    advanced = entry.section("advanced")
    normalise, refinements = advanced.plain("normalize_mesh", False), entry.plain("n_refs", 0)
    advanced.close()
    entry.only("extract", ("volume",), "a deformable geometry must be a volume")
    if not 0 <= refinements <= MOST_REFINEMENTS:
        entry.refuse("n_refs", f"0 to {MOST_REFINEMENTS} uniform refinements are possible")
        refinements = 0
    if shape is not None and not isinstance(shape, Solid):
        entry.refuse("mesh", "holds a surface; a deformable geometry needs a mesh of tetrahedra")
        shape = None
    if shape is None:
        return []
    points, cells = shape.vertices, shape.cells.astype(np.int64)
    if normalise:
        points = (points - points.min(axis=0)) / np.ptp(points, axis=0).max()
    points = _transformed(entry, points)
    low, high = points.min(axis=0), points.max(axis=0)
    offsets, surface = _offsets(entry, high - low), read_selections(entry, "surface_selection", low, high)
    offset = entry.get("volume_selection")
    if isinstance(offset, dict) and set(offset) == {"id_offset"} and isinstance(offset["id_offset"], int):
        volume, stored = [], shape.regions + offset["id_offset"]
    else:
        volume, stored = read_selections(entry, "volume_selection", low, high), shape.regions
    entry.close()
    if refinements and len(np.unique(stored)) > 1:
        entry.refuse("n_refs", "the mesh has several volume numbers, as PolyFEM too does not refine")
    solids, regions = [], stored
    for level in range(refinements + levels):
        if level:
            points, cells = halved(points, cells, line=0)  # as PolyFEM does
            regions = np.repeat(regions, 2 ** points.shape[1])
        if level >= refinements:
            numbers = numbers_at(volume, simplex_centres(points, cells), regions)
            solids.append(Solid(points, oriented(points, cells).astype(np.int32), numbers.astype(np.int32)))
    return [
        Meshed(
            name if len(offsets) == 1 else f"{name} copy {number}",
            path,
            tuple(Solid(solid.vertices + offset, solid.cells, solid.regions) for solid in solids),
            tuple(surface),
            offset,
        )
        for number, offset in enumerate(offsets, 1)
    ]


def read_surfaces(entry: Section, folder: Path) -> list[Surface]:
    """The surface of an obstacle, or all of an array of it; none where something of it was refused."""
    placed = _surface(entry, folder, entry.get("mesh"), "mesh")
    if placed is None:
        return []
    offsets = _offsets(entry, np.ptp(placed.vertices, axis=0))
    entry.close()
    return [Surface(placed.vertices + offset, placed.triangles) for offset in offsets]


def read_sequence(entry: Section, folder: Path, start: float) -> PointCache | None:
    """The motion of an obstacle that a mesh file per frame gives, with the shot's beginning at `start` [s] of its time;
    None where something of it was refused.
    """
    given, fps = entry.get("mesh_sequence"), entry.plain("fps", 0.0)
    if isinstance(given, str):
        files = [str(file) for file in (folder / given).iterdir()] if (folder / given).is_dir() else None
        files = [file for file in files or glob(str(folder / given), recursive=True) if Path(file).is_file()]
        files.sort(key=lambda file: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", file)])
    else:
        files = given if isinstance(given, list) and all(isinstance(file, str) for file in given) else []
    if not files:
        entry.refuse("mesh_sequence", "mesh files are expected here: a folder, a pattern or a list")
        return None
    frames = [_surface(entry, folder, file, "mesh_sequence") for file in files]
    entry.get("surface_selection")  # as in PolyFEM, no displacement is added
    entry.close()
    found = [frame for frame in frames if frame is not None]
    if len(found) < len(files):
        return None
    for file, frame in zip(files, found, strict=True):
        if not np.array_equal(frame.triangles, found[0].triangles):
            entry.refuse("mesh_sequence", f"{Path(file).name} has other triangles than {Path(files[0]).name}")
            return None
    try:
        points = np.array([frame.vertices for frame in found])
        return PointCache(points, fps=fps, begin=-start, faces=found[0].triangles)
    except InputError as error:
        entry.refuse("fps", str(error))
        return None


def _offsets(entry: Section, size: np.ndarray) -> list[np.ndarray]:
    """(d,) [m] of each mesh of a `mesh_array`, whose first one has this size (d,) [m]; one of zero for a `mesh`."""
    if entry.get("type", "mesh") != "mesh_array":
        return [np.zeros(len(size))]
    array = entry.section("array")
    lack = f"{len(size)} whole numbers are expected here, at most {MOST_COPIES} meshes in all"
    counts, step, relative = array.wholes("size", [], lack), array.plain("offset", 0.0), array.plain("relative", False)
    array.close()
    if len(counts) != len(size) or min(counts) < 1 or np.prod(counts) > MOST_COPIES:
        array.refuse("size", lack)
        return [np.zeros(len(size))]
    return [step * np.array(place) * (size if relative else 1.0) for place in product(*map(range, counts))]


def _surface(entry: Section, folder: Path, file: object, key: str) -> Surface | None:
    """The surface of a mesh file, placed; None where something of it was refused."""
    shape = _shape(entry, folder, file, key)
    entry.only("extract", ("volume", "surface"), "pdvol's obstacles are surfaces, without single edges and points")
    entry.only("n_refs", (0,), "obstacles are not refined")
    entry.section("advanced")
    if shape is None:
        return None
    if isinstance(shape, Solid) and shape.vertices.shape[1] == 2:
        entry.refuse(key, "obstacles of 2D scenes are not read")
        return None
    if isinstance(shape, Solid):
        faces, _ = boundary_facets(oriented(shape.vertices, shape.cells.astype(np.int64)))
        used, corners = np.unique(faces, return_inverse=True)
        shape = Surface(shape.vertices[used], corners.reshape(faces.shape).astype(np.int32))
    return Surface(_transformed(entry, shape.vertices), shape.triangles)


def _shape(entry: Section, folder: Path, file: object, key: str) -> Solid | Surface | None:
    """What a mesh file has that a key of the geometry names."""
    if not isinstance(file, str):
        entry.refuse(key, "the path of a mesh file is expected here")
        return None
    try:
        shape = read_shape(folder / file)
    except InputError as error:
        entry.refuse(key, str(error))
        return None
    if not isinstance(shape, Solid | Surface):
        entry.refuse(key, "pdvol reads volumes and surfaces")
        return None
    return shape


def _transformed(entry: Section, points: np.ndarray) -> np.ndarray:
    """Points (n, d) scaled, rotated and translated by the geometry's `transformation`."""
    given, dim = entry.section("transformation"), points.shape[1]
    size = np.ptp(points, axis=0)
    if isinstance(given.get("dimensions"), list):
        given.get("scale")
        scale = _filled(given, "dimensions", dim) / np.where(size == 0.0, 1.0, size)
    elif isinstance(given.get("scale"), list):
        scale = _filled(given, "scale", dim) if given.get("scale") else np.ones(dim)
    else:
        scale = np.full(dim, given.plain("scale", 1.0))
    moved = (points * scale) @ _rotation(given, dim).T + _filled(given, "translation", dim)
    given.close()
    return moved


def _filled(given: Section, key: str, dim: int) -> np.ndarray:
    """(dim,) the numbers of a list; those that it lacks are zero."""
    listed = given.get(key, [])
    numbers = listed if isinstance(listed, list) else [None]
    if len(numbers) > 3 or not all(is_a(number, float) for number in numbers):
        given.refuse(key, f"a list of {dim} numbers is expected here")
        return np.ones(dim)
    return np.array([*numbers, 0.0, 0.0, 0.0][:dim], dtype=float)


def _rotation(given: Section, dim: int) -> np.ndarray:
    """The rotation matrix (dim, dim) of `rotation` [degrees], by `rotation_mode`."""
    value, mode = given.get("rotation", []), str(given.get("rotation_mode", "xyz")).lower()
    if value == []:
        return np.eye(dim)
    try:
        r = np.array(value if isinstance(value, list) else [value], dtype=float)
        if dim == 2:
            turn = Rotation.from_euler("z", r.item(), degrees=True)
        elif mode == "axis_angle":
            if len(r) != 4 or not r[1:].any():
                raise ValueError(r)
            turn = Rotation.from_rotvec(r[0] * r[1:] / np.linalg.norm(r[1:]), degrees=True)
        elif mode == "rotation_vector":
            turn = Rotation.from_rotvec(r, degrees=True)
        else:
            angles = r if len(r) == len(mode) == 1 else [dict(zip("xyz", r, strict=True))[axis] for axis in mode]
            turn = Rotation.from_euler(mode, angles, degrees=True)
        return turn.as_matrix()[:dim, :dim]
    except (TypeError, ValueError, KeyError):
        given.refuse("rotation", f"is not read with rotation_mode {mode!r} in {dim}D")
        return np.eye(dim)
