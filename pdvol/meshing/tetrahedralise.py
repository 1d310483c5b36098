"""Tetrahedra inside a closed surface, with a given number of vertices and the surface's volume, by fTetWild.

The surface is decimated (or its longest edges are split) to the number of vertices that a mesh of the wanted size has
on its boundary, then meshed within a narrow envelope, in coordinates about its centre and in units of its size.
"""

from collections.abc import Callable
from itertools import combinations

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.flat_faces import FlatFaces
from pdvol.geometry.level_mesh import boundary_facets, facet_sizes, simplex_volumes
from pdvol.meshes import Surface
from pdvol.meshing.decimate import decimate, split_longest_edges, topology
from pdvol.meshing.edge_length import (
    BASE_CPU_SECONDS,
    CLOSEST_FACTOR,
    CPU_SECONDS_PER_VERTEX,
    SizedMesh,
    UnreachableCount,
    edge_length,
    expected_vertices,
    mesh_of_target_size,
)
from pdvol.meshing.meshers import ftetwild
from pdvol.meshing.validate import check_surface, drop_unused, shells
from pdvol.meshing.volume import with_volume

ENVELOPE_WIDTH = 0.1
"""Distance that fTetWild may move the decimated surface, relative to the edge length: half of it takes twice as long,
twice of it doubles the distance from the input.
"""
SURFACE_FACTOR = 1.3
"""Number of vertices of the decimated surface, relative to the number expected on the boundary: for finer features.
The inside is coarser for it, and so is the space around the shape, which fTetWild meshes, too: that takes its time.
"""
SPARSE_SURFACE = 2.5
"""Number of vertices that a surface should have, relative to those it has, above which its edges are split. With less,
fTetWild splits them.
"""
SPLIT_EDGE_FACTOR = 0.85
"""Edge length, relative to the expected one, inside a surface whose edges were split: fTetWild collapses edges below
0.8 of its edge length, and with them what was split.
"""
LONGEST_EDGE = 0.4
"""Edge length given to fTetWild, relative to the diagonal, at most. It fills a box that is one edge length larger on
each side with points a fifteenth of the diagonal apart: 116,000 for a cube at 1.3, which take 13 s, and 8,000 at 0.4.
"""
MIN_QUALITY = 0.02
"""Mean-ratio quality of a mesh's worst cell below which it is refused; fTetWild's worst cells have 0.1 to 0.6."""
MIN_BOUNDARY_VERTICES = 12
"""Number of vertices below which a surface is not decimated: those of an icosahedron."""

LEAST_OF_A_PART = 20
"""Number of vertices that a body, or a part of one, is asked for at least: a cube of 20 takes all tries."""


def mean_ratio(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Quality (m,) of simplices: 1 for an equilateral one, 0 for a flat one (2D and 3D)."""
    d = points.shape[1]
    squares = sum(
        ((points[cells[:, i]] - points[cells[:, j]]) ** 2).sum(axis=1) for i, j in combinations(range(d + 1), 2)
    )
    volumes = np.maximum(simplex_volumes(points, cells), 0.0)
    return 4.0 * np.sqrt(3.0) * volumes / squares if d == 2 else 12.0 * (3.0 * volumes) ** (2.0 / 3.0) / squares


def surface_share(surface: Surface, target: int) -> int:
    """Number of vertices that the surface of a mesh of `target` vertices should have."""
    volume, area = volume_and_area(surface)
    expected = expected_vertices(edge_length(target, volume, area, 3), volume, area, 3)[0]
    return max(min(int(SURFACE_FACTOR * expected), target), MIN_BOUNDARY_VERTICES)


def tetrahedralise(
    surface: Surface, target: int, name: str = "surface", volume: float | None = None, flat: FlatFaces | None = None
) -> SizedMesh:
    """A tetrahedral mesh of about `target` vertices (see `edge_length`) inside a valid surface, with its shells and
    handles; `name` begins messages.

    It has a `volume` [m^3], the surface's own if not given, and keeps the `flat` faces of the input where its cells
    stay valid. It raises UnreachableCount where meshes of the surface have other numbers of vertices, and MeshError
    where no mesh was found within `MAX_ATTEMPTS`.
    """

    def make(part: Surface, count: int, what: str) -> SizedMesh:
        size = volume_and_area(part)[0] ** (1.0 / 3.0)
        centre = part.vertices.mean(axis=0)
        unit = Surface((part.vertices - centre) / size, part.triangles)
        made = _unit_mesh(unit, count, what, grown, None if flat is None else flat.relative(centre, size))
        return made.placed(centre, size)

    grown = 1.0 if volume is None else volume / volume_and_area(surface)[0]
    return in_parts(make, surface, target, name)


def in_parts(make: Callable[[Surface, int, str], SizedMesh], surface: Surface, target: int, name: str) -> SizedMesh:
    """The meshes that `make(part, count, name)` gives for each shell of a surface, in one set of arrays. A mesher of
    all would also fill the space between them, and refine where they are near each other.

    It raises as `make` does, and where the surface encloses no volume or has more shells than the count allows.
    """
    own, area = volume_and_area(surface)
    if own <= 0:
        raise MeshError(f"{name}: the surface encloses no volume; turn its triangles outward")
    owner, first = shells(surface.vertices, surface.triangles)
    alone = (drop_unused(surface.vertices, surface.triangles[owner == shell]) for shell in range(len(first)))
    parts = [Surface(points, triangles.astype(np.int32)) for points, triangles in alone]
    if len(parts) == 1 or not all(enclosed_volume(part.vertices, part.triangles) > 0 for part in parts):
        return make(surface, target, name)
    h = edge_length(target, own, area, 3)
    fractions = [max(round(expected_vertices(h, *volume_and_area(p), 3)[1]), LEAST_OF_A_PART) for p in parts]
    if sum(fractions) > CLOSEST_FACTOR * target:
        few = f"{target} vertices are too few for its {len(parts)} parts"
        raise MeshError(f"{name}: {few}; ask for {sum(fractions)} or more, or join parts")
    try:
        return _merged(
            [
                make(part, fraction, f"{name}, part {k} of {len(parts)}")
                for k, (part, fraction) in enumerate(zip(parts, fractions, strict=True), 1)
            ]
        )
    except UnreachableCount as error:
        raise UnreachableCount(
            f"{name}: {target} vertices cannot be had for all parts ({str(error).removeprefix(f'{name}, ')})",
            target,
            round(target * error.closest / error.target),
        ) from error


def _unit_mesh(surface: Surface, target: int, name: str, volume: float, flat: FlatFaces | None) -> SizedMesh:
    """As `tetrahedralise`, of one shell of volume 1 about the origin."""
    h = edge_length(target, *volume_and_area(surface), 3)
    wanted = topology(surface.triangles, len(surface.vertices))
    sparse = surface_share(surface, target) > SPARSE_SURFACE * len(surface.vertices)
    cpu_seconds = BASE_CPU_SECONDS + CPU_SECONDS_PER_VERTEX * target

    def make(scale: float, failures: int) -> SizedMesh:
        fraction = max(int(surface_share(surface, target) / scale**2), MIN_BOUNDARY_VERTICES)
        # Coarse meshes have relatively more vertices at sharp edges, and fewer inside.
        coarse, longer, width = surface, 1.23 + 5.0 / np.sqrt(target), ENVELOPE_WIDTH
        if fraction < len(surface.vertices):
            coarse = decimate(surface, fraction, name)
        elif sparse:
            coarse, longer = split_longest_edges(surface, fraction), SPLIT_EDGE_FACTOR
        else:
            width *= 0.5  # all of the distance from the input is then the envelope's
        # Parts closer than two envelopes merge: after each failure the envelope is half as wide.
        envelope = float(width * scale * h * 0.5**failures)
        diagonal = float(np.linalg.norm(np.ptp(coarse.vertices, axis=0)))
        length = min(scale * longer * h, LONGEST_EDGE * diagonal)
        made = ftetwild(coarse.vertices, coarse.triangles, length, envelope / diagonal, cpu_seconds)
        points, cells = oriented(*made, name)
        boundary = np.unique(boundary_facets(cells)[0])
        snapped = points.copy()
        if flat is not None:
            snapped[boundary] = flat.onto(points[boundary], flat.near(points[boundary], envelope))
        try:
            mesh = with_volume_checked(snapped, cells, volume, flat, wanted, MIN_QUALITY, name)
        except MeshError:
            if flat is None:
                raise
            mesh = with_volume_checked(points, cells, volume, None, wanted, MIN_QUALITY, name)
        if flat is not None:
            mesh.places[boundary] = flat.nearest(snapped[boundary])
        return mesh

    return mesh_of_target_size(make, target, name, 0.87 + 3.6 / np.sqrt(target), 3)


def with_volume_checked(
    points: np.ndarray,
    cells: np.ndarray,
    volume: float,
    flat: FlatFaces | None,
    wanted: tuple[int, int],
    least: float,
    name: str,
) -> SizedMesh:
    """The mesh with a volume [m^3] by the gentlest change (`with_volume`) that leaves it valid.

    It raises MeshError where none does: the worst cell has a quality below `least`, the boundary crosses itself, or its
    shells and Euler number are not those `wanted`.
    """
    refused = MeshError(name)
    for moved in with_volume(points, cells, volume, flat):
        try:
            _check(moved, cells, wanted, least, name)
            return SizedMesh(moved, cells, points)
        except InputError as error:
            refused = MeshError(str(error))
    raise refused


def volume_and_area(surface: Surface) -> tuple[float, float]:
    """Volume [m^3] inside a closed surface, and its area [m^2]."""
    points, triangles = surface.vertices, surface.triangles
    return enclosed_volume(points, triangles), float(facet_sizes(points, triangles).sum())


def _merged(meshes: list[SizedMesh]) -> SizedMesh:
    """Several meshes in one set of arrays. Their boundaries have moved by less than an envelope each;
    `levels.initial_state` finds out if they then cross.
    """
    starts = np.cumsum([0, *(len(m.points) for m in meshes)])
    cells = np.vstack([m.cells + start for m, start in zip(meshes, starts, strict=False)])
    return SizedMesh(np.vstack([m.points for m in meshes]), cells, np.vstack([m.places for m in meshes]))


def oriented(points: np.ndarray, cells: np.ndarray, name: str) -> tuple[np.ndarray, np.ndarray]:
    """A mesher's result with positive cells and without unused points."""
    if len(cells) == 0:
        raise MeshError(f"{name}: the mesher returned no cells")
    points, cells = drop_unused(np.asarray(points, dtype=np.float64), np.asarray(cells, dtype=np.int64))
    negative = simplex_volumes(points, cells) < 0
    cells[negative] = cells[negative][:, [1, 0, 2, 3]]
    return points, cells


def _check(points: np.ndarray, cells: np.ndarray, wanted: tuple[int, int], least: float, name: str) -> None:
    """Raise MeshError unless the mesh is a valid solid with the wanted topology."""
    worst = float(mean_ratio(points, cells).min())
    if worst < least:
        raise MeshError(f"{name}: the worst cell has quality {worst:.2g}")
    facets, _ = boundary_facets(cells)
    boundary, triangles = drop_unused(points, facets)
    try:
        check_surface(Surface(boundary, triangles), f"{name}, meshed")
    except InputError as error:
        raise MeshError(str(error)) from error
    count, euler = topology(triangles, len(boundary))
    if (count, euler) != wanted:
        raise MeshError(
            f"{name}: the mesh has {count} shells and Euler number {euler} where the surface has {wanted[0]} and"
            f" {wanted[1]}"
        )
