"""Mends a shape where it can be mended without guessing what was meant, and says each thing that it did.

A surface is welded, rid of what is doubled or has no area, oriented, split where it is not manifold, and its holes are
filled. What still crosses itself is enclosed by a mesh of fTetWild, whose boundary stays within an envelope of the
given surface. Nothing here is done by a run: `pdvol repair` asks for it.
"""

import igl
import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.crossings import edges_of
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.holes import filled_holes
from pdvol.meshing.meshers import ftetwild
from pdvol.meshing.validate import (
    FLAT_SIMPLEX,
    drop_unused,
    flat_triangles,
    repeated,
    shells,
    shells_around,
    simplex_lengths,
)
from pdvol.meshing.verdict import judge
from pdvol.meshing.weld import coincident, open_edges

ENVELOPE_EDGE = 0.04
"""Edge length of fTetWild's mesh in a repair, in diagonals: its boundary keeps to the envelope anyway."""
MESHER_SECONDS = 100.0
"""Time [s] that fTetWild may take in a repair."""
PARTED = 1e-3
"""Share of its way to its neighbours by which each copy of a split vertex moves: the copies must not touch."""
MOST_FLIPS = 10
"""Rounds in which edges are turned against triangles without area; one is enough for polygons cut in fans."""


def repair(
    shape: Outline | Surface | Solid, weld: float, hole: float, envelope: float, name: str
) -> tuple[Surface | Solid, list[str]]:
    """The mended shape, and a line for each thing that was done.

    Parameters
    ----------
    weld : distance in diagonals up to which vertices are joined
    hole : length of a hole's rim in diagonals up to which it is filled
    envelope : distance in diagonals by which the surface may move where it crosses itself; 0: leave crossings
    name : for messages

    Raises
    ------
    MeshError
        The shape is an outline, is empty, or nothing is left of it.
    """
    if isinstance(shape, Outline):
        raise MeshError(f"{name}: an outline; repair mends surfaces and volume meshes")
    points = np.asarray(shape.vertices, dtype=np.float64)
    given = np.asarray(shape.cells if isinstance(shape, Solid) else shape.triangles, dtype=np.int64)
    if given.size == 0 or points.size == 0:
        raise MeshError(f"{name}: the mesh is empty; give one with cells")
    done: list[str] = []
    inside: np.ndarray = np.all((given >= 0) & (given < len(points)), axis=1)
    sound = inside & np.isfinite(points[np.where(inside[:, None], given, 0)]).all(axis=(1, 2))
    _say(done, (~sound).sum(), "{} cells of missing or infinite vertices dropped")
    if not sound.any():
        raise MeshError(f"{name}: no cell has all its vertices; export the mesh again")
    cells, regions = given[sound], shape.regions[sound] if isinstance(shape, Solid) else None
    unused = len(points) - len(np.unique(cells))
    points, cells = drop_unused(points, cells)
    _say(done, unused, "{} unused vertices dropped")
    points, cells = _weld(points, cells, weld, done)
    corners = np.sort(cells, axis=1)
    keep = (np.diff(corners, axis=1) > 0).all(axis=1)
    _say(done, (~keep).sum(), "{} cells that had lost a corner dropped")
    cells, regions = cells[keep], None if regions is None else regions[keep]
    keep = np.ones(len(cells), dtype=bool)
    keep[repeated(cells)] = False
    _say(done, (~keep).sum(), "{} doubled cells dropped")
    cells, regions = cells[keep], None if regions is None else regions[keep]
    if len(cells) == 0:
        raise MeshError(f"{name}: nothing is left of it; export the mesh again, or join fewer vertices (--weld)")
    if regions is not None:
        return _solid(points, cells, regions, done), done
    surface = _surface(points, cells, hole, done)
    return (_enclosed(surface, hole, envelope, name, done) if envelope > 0.0 else surface), done


def _say(done: list[str], count: int, line: str) -> None:
    if count:
        done.append(line.format(f"{int(count):,}"))


def _diagonal(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _weld(points: np.ndarray, cells: np.ndarray, fraction: float, done: list[str]) -> tuple[np.ndarray, np.ndarray]:
    first = coincident(points, fraction * _diagonal(points))
    _say(done, (first != np.arange(len(first))).sum(), "{} vertices welded to others")
    return drop_unused(points, first[cells])


def _solid(points: np.ndarray, cells: np.ndarray, regions: np.ndarray, done: list[str]) -> Solid:
    volumes, longest = simplex_volumes(points, cells), simplex_lengths(points, cells)
    thick = np.abs(volumes) > FLAT_SIMPLEX * longest ** points.shape[1]
    _say(done, (~thick).sum(), "{} flat cells dropped")
    cells, regions, volumes = cells[thick], regions[thick], volumes[thick]
    cells[volumes < 0, :2] = cells[volumes < 0, 1::-1]
    _say(done, (volumes < 0).sum(), "{} inverted cells turned")
    points, cells = drop_unused(points, cells)
    return Solid(points, cells.astype(np.int32), regions.astype(np.int32))


def _surface(points: np.ndarray, triangles: np.ndarray, hole: float, done: list[str]) -> Surface:
    triangles = _without_flat(points, triangles, done)
    if len(triangles):
        triangles = _oriented(triangles, done)
        points, triangles = _split(points, triangles, done)
        points, triangles, filled, large = filled_holes(points, triangles, hole * _diagonal(points))
        _say(done, filled, "{} holes filled")
        _say(done, large, "{} holes left open: their rims are longer than --hole allows")
        points, triangles = drop_unused(points, _outward(points, triangles, done))
    return Surface(points, triangles.astype(np.int32))


def _without_flat(points: np.ndarray, triangles: np.ndarray, done: list[str]) -> np.ndarray:
    """Triangles without area turned against the neighbour across their longest edge, or dropped."""
    turned, triangles = 0, triangles.copy()
    for _ in range(MOST_FLIPS):
        flat = flat_triangles(points, triangles)
        touched: set[int] = set()
        for t in flat:
            corners = triangles[t]
            sides = [np.linalg.norm(points[corners[(k + 1) % 3]] - points[corners[(k + 2) % 3]]) for k in range(3)]
            k = int(np.argmax(sides))
            b, c, a = corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]  # b lies on the edge from c to a
            others = np.flatnonzero(((triangles == a) | (triangles == c)).sum(axis=1) == 2)
            others = others[others != t]
            if len(others) == 1 and not touched & {int(t), int(others[0])}:
                other = triangles[others[0]]
                d = int(other[(other != a) & (other != c)][0])
                along = (int(a), int(c)) in {(int(other[i]), int(other[(i + 1) % 3])) for i in range(3)}
                pair = [(a, b, d), (b, c, d)] if along else [(b, a, d), (c, b, d)]
                triangles[t], triangles[others[0]] = pair
                touched |= {int(t), int(others[0])}
                turned += 1
        if not touched:
            break
    flat = flat_triangles(points, triangles)
    _say(done, turned, "{} triangles without area joined to their neighbours")
    _say(done, len(flat), "{} triangles without area dropped")
    return np.delete(triangles, flat, axis=0)


def _oriented(triangles: np.ndarray, done: list[str]) -> np.ndarray:
    """Neighbouring triangles turned the same way; each connected part as most of it is."""
    turned, part = igl.bfs_orient(np.ascontiguousarray(triangles))[:2]
    turned = np.asarray(turned, dtype=np.int64)
    changed = (turned != triangles).any(axis=1)
    for number in np.unique(part):
        mine = part == number
        if changed[mine].sum() > mine.sum() / 2:
            turned[mine] = turned[mine][:, ::-1]
            changed[mine] = ~changed[mine]
    _say(done, changed.sum(), "{} triangles turned to agree with their neighbours")
    return turned


def _split(points: np.ndarray, triangles: np.ndarray, done: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices in which parts meet that are not joined by an edge of two triangles, split and moved into each part."""
    split, source = igl.split_nonmanifold(np.ascontiguousarray(triangles))
    copies = np.flatnonzero(np.bincount(source)[source] > 1)
    if not len(copies):
        return points, triangles
    _say(done, len(copies), "{} vertices made of those in which parts met")
    places, edges = points[source], edges_of(split)
    middles = np.zeros_like(places)
    for one, other in (edges.T, edges.T[::-1]):
        np.add.at(middles, one, places[other])
    middles /= np.bincount(edges.ravel(), minlength=len(places))[:, None]
    places[copies] += PARTED * (middles - places)[copies]
    return places, split


def _outward(points: np.ndarray, triangles: np.ndarray, done: list[str]) -> np.ndarray:
    """Closed shells turned outward; those inside others inward, as cavities."""
    if len(open_edges(triangles)):
        return triangles
    owner, first = shells(points, triangles)
    triangles, turned = triangles.copy(), 0
    for shell, depth in enumerate(np.abs(shells_around(points, triangles, owner, first)).sum(axis=1)):
        mine = owner == shell
        if (enclosed_volume(points, triangles[mine]) < 0) != bool(depth % 2):
            triangles[mine] = triangles[mine][:, ::-1]
            turned += 1
    _say(done, turned, "{} shells turned inside out")
    return triangles


def _enclosed(surface: Surface, hole: float, envelope: float, name: str, done: list[str]) -> Surface:
    """The surface where it is sound; else the boundary of fTetWild's mesh of what it encloses, if that is sound."""
    try:
        judge(surface, name)
        return surface
    except InputError:
        pass
    points = surface.vertices - surface.vertices.mean(axis=0)
    size = _diagonal(points)
    try:
        made, cells = ftetwild(points / size, surface.triangles, ENVELOPE_EDGE, envelope, MESHER_SECONDS)
        cells = cells.astype(np.int64)
        inverted = simplex_volumes(made, cells) < 0
        cells[inverted, :2] = cells[inverted, 1::-1]
        facets = boundary_facets(cells)[0]
        found, steps = drop_unused(made * size + surface.vertices.mean(axis=0), facets), list[str]()
        enclosed = _surface(*found, hole, steps)
        judge(enclosed, name)
    except InputError as error:
        done.append(f"no envelope found that mends the rest ({error})")
        return surface
    done.append(
        f"meshed anew: the boundary of what it encloses, moved by up to {envelope:g} of its size"
        f" ({len(surface.triangles):,} triangles became {len(enclosed.triangles):,})"
    )
    done += [f"of the new boundary, {step}" for step in steps]
    return enclosed
