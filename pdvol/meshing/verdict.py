"""One verdict on a body's shape: the same for `pdvol check`, `pdvol hierarchy` and `pdvol run`.

What would stop or spoil a run is an error of one line. What is only worth knowing is a note.
"""

from typing import TypeAlias, TypeVar

import numpy as np

from pdvol.errors import MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.meshing.triangulate import boundary_loops, polygons
from pdvol.meshing.validate import check_outline, check_solid, check_surface, drop_unused, some
from pdvol.meshing.weld import COINCIDENT, coincident

POOR_QUALITY = 0.05  # mean ratio below which a cell makes the linear solver need more iterations
SMALLEST_BODY = 1e-6  # diagonal [m] below which a length is a mistaken unit, and numbers leave the range that is tested
FARTHEST_BODY = 1e7  # distance from the origin in diagonals of a body: round-off there is 1e-6 of the default dhat
MOST_ASPECT = 1e6  # longest over shortest extent: such a body is thinner than the distances at which contact works
FLAT_ASPECT = 1e12  # the same of points in a plane, to round-off
Shape = TypeVar("Shape", Outline, Surface, Solid)
Boundary: TypeAlias = Surface | list[np.ndarray]
"""A surface in 3D, closed polygons (k, 2) in 2D."""


def judge(shape: Shape, name: str) -> tuple[Shape, Boundary, list[str]]:
    """A shape, as it was read, made fit to be a body; its boundary; and notes. `name` is that of the body or file.

    It raises MeshError and IntersectionError as `check_outline`, `check_surface` and `check_solid` do; a solid's
    boundary is checked as a surface is.
    """
    if isinstance(shape, Outline):
        outline = check_outline(shape, name)
        return outline, [outline.points], []
    if isinstance(shape, Surface):
        surface = check_surface(shape, name)
        notes = _unused(shape.vertices, shape.triangles, "triangle")
        if enclosed_volume(shape.vertices, shape.triangles) < 0.0:
            notes.append("all triangles face inward; they are turned")
        return surface, surface, notes
    solid = check_solid(shape, name)
    points, cells = np.asarray(shape.vertices, dtype=np.float64), np.asarray(shape.cells)
    notes = _unused(points, cells, "cell")
    if simplex_volumes(points, cells)[0] < 0.0:
        notes.append("all cells are inverted; they are turned")
    quality = mean_ratio(solid.vertices, solid.cells)
    slivers = np.flatnonzero(quality < POOR_QUALITY)
    if len(slivers):
        worst = slivers[np.argsort(quality[slivers], kind="stable")]
        notes.append(
            f"{len(slivers)} cells are slivers (mean ratio below {POOR_QUALITY:g}), which cost iterations:"
            f" {some(worst)}"
        )
    return solid, solid_boundary(solid, name), notes


def solid_boundary(solid: Solid, name: str) -> Boundary:
    """The checked boundary of a checked mesh: a surface, or loops with the material on their left."""
    size = float(np.linalg.norm(np.ptp(solid.vertices, axis=0)))
    first = coincident(solid.vertices, COINCIDENT * size)
    doubled = np.flatnonzero(first != np.arange(len(first)))
    if len(doubled):
        raise MeshError(
            f"{name}: weld: {len(doubled)} vertices coincide with others within {COINCIDENT:g} of its size,"
            f" {some(np.column_stack([first[doubled], doubled]))}; cells are not joined there, pdvol repair joins them"
        )
    points, facets = drop_unused(solid.vertices, boundary_facets(solid.cells.astype(np.int64))[0])
    if facets.shape[1] == 3:
        return check_surface(Surface(points, facets.astype(np.int32)), f"{name}, boundary")
    return boundary_loops(points, facets, f"{name}, boundary")


def boundary_facets_of(boundary: Boundary) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, d) [m] of a boundary, and its triangles (k, 3) or edges (k, 2)."""
    if isinstance(boundary, Surface):
        return boundary.vertices, boundary.triangles.astype(np.int64)
    return polygons(boundary)


def check_place(points: np.ndarray, name: str) -> None:
    """Raise MeshError unless a body's points (n, d) [m], as placed, have a size and a place to compute with.

    Called before `judge`, whose geometry fails where numbers have no precision. Points in a plane are left to it.
    """
    if len(points) <= points.shape[1]:
        return
    low, high = points.min(axis=0), points.max(axis=0)
    diagonal, away = float(np.linalg.norm(high - low)), float(np.linalg.norm((low + high) / 2))
    if diagonal < SMALLEST_BODY:
        raise MeshError(f"{name}: {diagonal:.3g} m across; lengths are metres, scale it up, as by Placement(scale=1e3)")
    if away > FARTHEST_BODY * diagonal:
        raise MeshError(
            f"{name}: {away:.3g} m from the origin with a size of {diagonal:.3g} m, where coordinates lose their"
            " precision; move the scene to the origin"
        )
    centred = (points - points.mean(axis=0)) / diagonal
    axes = np.linalg.eigh(centred.T @ centred)[1]
    extents = np.ptp(centred @ axes, axis=0)
    aspect = extents.max() / max(extents.min(), np.finfo(float).tiny)
    if MOST_ASPECT < aspect < FLAT_ASPECT:
        raise MeshError(
            f"{name}: {aspect:.1e} times as long as it is thin; {MOST_ASPECT:g} is the most, give it more thickness"
        )


def place_of(shape: Outline | Surface | Solid) -> np.ndarray:
    """The points (k, d) that a shape uses, so far as they exist and are finite."""
    points = np.asarray(shape.points if isinstance(shape, Outline) else shape.vertices, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3):
        return np.empty((0, 3))
    if not isinstance(shape, Outline):
        cells = np.unique(shape.triangles if isinstance(shape, Surface) else shape.cells)
        points = points[cells[(cells >= 0) & (cells < len(points))].astype(np.int64)]
    return points[np.isfinite(points).all(axis=1)]


def _unused(points: np.ndarray, cells: np.ndarray, kind: str) -> list[str]:
    unused = len(points) - len(np.unique(cells))
    return [f"{unused:,} of {len(points):,} vertices belong to no {kind}; they are dropped"] if unused else []
