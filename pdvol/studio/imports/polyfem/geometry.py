"""Meshes of a PolyFEM scene: read, normalised, transformed and refined in PolyFEM's order."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.halved_cells import halved, oriented
from pdvol.geometry.level_mesh import boundary_facets
from pdvol.meshes import Solid, Surface
from pdvol.meshing.readers import read_shape
from pdvol.scene.motions import rotation_matrix
from pdvol.studio.imports.polyfem.document import Section
from pdvol.studio.imports.polyfem.selections import UNSELECTED, Selection, numbers_at, read_selections

MOST_REFINEMENTS = 6  # uniform refinements of a mesh: more are a typing error
_AXES = np.eye(3)


@dataclass(frozen=True)
class Meshed:
    """A deformable geometry.

    Attributes
    ----------
    name : of the body
    path : in the JSON
    levels : a `Solid` each, whose regions are volume numbers
    surface : the selections of its facets
    """

    name: str
    path: str
    levels: tuple[Solid, ...]
    surface: tuple[Selection, ...]

    @property
    def numbers(self) -> tuple[int, ...]:
        """The volume numbers of its cells, ascending."""
        return tuple(np.unique(self.levels[0].regions).tolist())

    def selected(self, wanted: set[int] | None) -> np.ndarray:
        """(n, d) the vertices, of all levels, of boundary facets with one of these numbers; of all facets for None."""
        found = []
        for solid in self.levels:
            facets, _ = boundary_facets(solid.cells.astype(np.int64))
            centres = solid.vertices[facets].mean(axis=1)
            numbers = numbers_at(list(self.surface), centres, np.full(len(facets), UNSELECTED))
            chosen = np.ones(len(facets), dtype=bool) if wanted is None else np.isin(numbers, list(wanted))
            found.append(solid.vertices[np.unique(facets[chosen])])
        return np.unique(np.concatenate(found), axis=0)


def read_body(entry: Section, folder: Path, name: str, levels: int) -> Meshed | None:
    """A deformable mesh; None where something of it was refused."""
    shape, path = _shape(entry, folder), entry.at("mesh")
    advanced = entry.section("advanced")
    normalise, refinements = advanced.flag("normalize_mesh", False), entry.whole("n_refs", 0)
    advanced.only("refinement_location", (0.5,), "pdvol halves edges")
    advanced.only("force_linear_geometry", (False,), "pdvol reads quadratic cells by their corners")
    advanced.only("min_component", (-1,), "pdvol has no counterpart")
    advanced.close()
    entry.only("extract", ("volume",), "a deformable geometry must be a volume")
    for key in ("point_selection", "curve_selection"):
        if entry.get(key) not in (None, []):
            entry.refuse(key, "pdvol reads selections of surfaces and volumes")
    if not 0 <= refinements <= MOST_REFINEMENTS:
        entry.refuse("n_refs", f"0 to {MOST_REFINEMENTS} uniform refinements are possible")
        refinements = 0
    if shape is not None and not isinstance(shape, Solid):
        entry.refuse("mesh", "holds a surface; a deformable geometry needs a mesh of tetrahedra")
        shape = None
    if shape is None:
        return None
    points, cells = shape.vertices, shape.cells.astype(np.int64)
    if normalise:
        points = (points - points.min(axis=0)) / np.ptp(points, axis=0).max()
    points = _transformed(entry, points)
    low, high = points.min(axis=0), points.max(axis=0)
    surface = read_selections(entry, "surface_selection", low, high)
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
            numbers = numbers_at(volume, points[cells].mean(axis=1), regions)
            solids.append(Solid(points, oriented(points, cells).astype(np.int32), numbers.astype(np.int32)))
    return Meshed(name, path, tuple(solids), tuple(surface))


def read_surface(entry: Section, folder: Path) -> Surface | None:
    """The surface of an obstacle; None where something of it was refused."""
    shape = _shape(entry, folder)
    entry.only("extract", ("volume", "surface"), "pdvol's obstacles are surfaces, without single edges and points")
    entry.only("n_refs", (0,), "obstacles are not refined")
    entry.section("advanced")
    if shape is None:
        return None
    if isinstance(shape, Solid) and shape.vertices.shape[1] == 2:
        entry.refuse("mesh", "obstacles of 2D scenes are not read")
        return None
    if isinstance(shape, Solid):
        faces, _ = boundary_facets(oriented(shape.vertices, shape.cells.astype(np.int64)))
        used, corners = np.unique(faces, return_inverse=True)
        shape = Surface(shape.vertices[used], corners.reshape(faces.shape).astype(np.int32))
    placed = Surface(_transformed(entry, shape.vertices), shape.triangles)
    entry.close()
    return placed


def _shape(entry: Section, folder: Path) -> Solid | Surface | None:
    given = entry.get("mesh")
    entry.only("unit", ("", "m"), "pdvol's lengths are metres; give the mesh in metres")
    if not isinstance(given, str):
        entry.refuse("mesh", "the path of a mesh file is expected here")
        return None
    try:
        shape = read_shape(folder / given)
    except InputError as error:
        entry.refuse("mesh", str(error))
        return None
    if not isinstance(shape, Solid | Surface):
        entry.refuse("mesh", "pdvol reads volumes and surfaces")
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
        scale = np.full(dim, given.number("scale", 1.0))
    moved = (points * scale) @ _rotation(given, dim).T + _filled(given, "translation", dim)
    given.close()
    return moved


def _filled(given: Section, key: str, dim: int) -> np.ndarray:
    """(dim,) the numbers of a list; those that it lacks are zero."""
    listed = given.get(key, [])
    numbers = listed if isinstance(listed, list) else [None]
    if len(numbers) > 3 or any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in numbers):
        given.refuse(key, f"a list of {dim} numbers is expected here")
        return np.ones(dim)
    return np.array([*numbers, 0.0, 0.0, 0.0][:dim], dtype=float)


def _rotation(given: Section, dim: int) -> np.ndarray:
    """The rotation matrix (dim, dim) of `rotation` [degrees], by `rotation_mode`."""
    value, mode = given.get("rotation", []), str(given.get("rotation_mode", "xyz")).lower()
    if value == []:
        return np.eye(dim)
    numbers = value if isinstance(value, list) else [value]
    if any(isinstance(v, bool) or not isinstance(v, (int, float)) for v in numbers):
        given.refuse("rotation", "numbers are expected here")
        return np.eye(dim)
    r = np.array(numbers, dtype=float)
    if dim == 2:
        if len(r) == 1:
            return rotation_matrix(float(np.deg2rad(r[0])), (0.0, 0.0, 1.0), 2)
    elif mode == "axis_angle" and len(r) == 4 and r[1:].any():
        return rotation_matrix(float(np.deg2rad(r[0])), r[1:], 3)
    elif mode == "rotation_vector" and len(r) == 3:
        return rotation_matrix(float(np.deg2rad(np.linalg.norm(r))), r, 3) if r.any() else np.eye(3)
    elif mode and set(mode) <= set("xyz") and (len(r) == 3 or len(r) == len(mode) == 1):
        angles = r if len(r) == 3 else _AXES["xyz".index(mode)] * r[0]
        turned = np.eye(3)
        for axis in map("xyz".index, mode):
            turned = rotation_matrix(float(np.deg2rad(angles[axis])), _AXES[axis], 3) @ turned
        return turned
    given.refuse("rotation", f"is not read with rotation_mode {mode!r} in {dim}D")
    return np.eye(dim)
