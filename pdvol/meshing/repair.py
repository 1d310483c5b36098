"""Mends a shape where it can be mended without guessing what was meant, and says each thing that it did.

A surface is welded, rid of what is doubled or has no area, oriented, split where it is not manifold, and its holes are
filled. Shells that cross or touch are united. The result is compared with the input. Nothing here is done by a run:
`pdvol repair` asks for it.
"""

from contextlib import suppress

import igl
import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.crossings import edges_of
from pdvol.geometry.distances import box_of, deviation
from pdvol.geometry.level_mesh import boundary_facets, connected_parts, facet_sizes, simplex_volumes
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.child_process import in_child
from pdvol.meshing.holes import ON_AN_EDGE, divided_edges, filled_holes, near_seam
from pdvol.meshing.meshers import united
from pdvol.meshing.validate import (
    FLAT_SIMPLEX,
    check_manifold,
    crossings_of,
    drop_unused,
    flat_triangles,
    mixed_edges,
    repeated,
    shells,
    shells_around,
    simplex_lengths,
)
from pdvol.meshing.verdict import judge
from pdvol.meshing.weld import COINCIDENT, coincident, open_edges

MESHER_SECONDS = 100.0
"""Time [s] that a union may take in a repair."""
SHEET = 1e-6
"""Volume of a closed shell, relative to its area times its diagonal, below which it is a sheet without thickness."""
MOST_SHEETS = 0.01
"""Share of a surface's area up to which sheets are dropped: crumbs of a scan. Larger ones were meant."""
SLIVER = 0.01
"""Distance of vertices that are joined where grown shells cross, relative to that by which they grew."""
UNCHANGED = 1e-6
"""Distance in diagonals, or relative volume, up to which two shapes count as the same: round-off of a file in text."""
PARTED = 1e-3
"""Share of its way to its neighbours by which each copy of a split vertex moves: the copies must not touch."""
MOST_FLIPS = 10
"""Rounds in which edges are turned against triangles without area; one is enough for polygons cut in fans."""


def repair(
    shape: Outline | Surface | Solid, weld: float, hole: float, envelope: float, name: str
) -> tuple[Surface | Solid, list[str]]:
    """The mended shape, and a line for each thing that was done, the last one a comparison with the given shape.

    In diagonals: vertices are joined up to a distance `weld`, holes with rims up to `hole` filled, and surfaces moved
    by up to `envelope` where shells are united, 0 leaves crossings. `name` begins messages.

    It raises MeshError where the shape is an outline or empty, nothing is left of it, or it has an opening wider than
    `hole`, a part of one side, or sheets that enclose nothing.
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
    points, cells = before = drop_unused(points, cells)
    _say(done, unused, "{} unused vertices dropped")
    points, cells, keep = _joined(points, cells, weld * _diagonal(points), _apart(points, cells), done)
    mended: Surface | Solid
    if regions is not None:
        mended = _solid(points, cells, regions[keep], name, done)
        after = mended.vertices, mended.cells.astype(np.int64)
    else:
        _check_left(cells, name)
        cells, count = divided_edges(points, cells, max(weld, ON_AN_EDGE) * _diagonal(points))
        _say(done, count, "{} open edges divided where the other side is")
        mended = _uncrossed(_surface(points, cells, hole, name, done), hole, envelope, name, done)
        after = mended.vertices, mended.triangles.astype(np.int64)
    if done and before[0].shape[1] == 3:
        done.append(_comparison(before, after))
    return mended, done


def _check_left(cells: np.ndarray, name: str) -> None:
    if len(cells) == 0:
        raise MeshError(f"{name}: nothing is left of it; export the mesh again, or join fewer vertices (--weld)")


def _say(done: list[str], count: int, line: str) -> None:
    if count:
        done.append(line.format(f"{int(count):,}"))


def _diagonal(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _joined(
    points: np.ndarray, cells: np.ndarray, distance: float, groups: np.ndarray | None, done: list[str]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points and cells after joining vertices of one group nearer than `distance` [m]; which cells are kept."""
    first = coincident(points, distance, groups)
    _say(done, (first != np.arange(len(first))).sum(), "{} vertices welded to others")
    cells = first[cells]
    whole = np.flatnonzero((np.diff(np.sort(cells, axis=1), axis=1) > 0).all(axis=1))
    _say(done, len(cells) - len(whole), "{} cells that had lost a corner dropped")
    keep = whole[_single(cells[whole])]
    _say(done, len(whole) - len(keep), "{} doubled cells dropped")
    return *drop_unused(points, cells[keep]), keep


def _apart(points: np.ndarray, cells: np.ndarray) -> np.ndarray | None:
    """(n,) a group of vertices for each closed shell, which touch others without being joined; 0 elsewhere."""
    if cells.shape[1] != 3:
        return None
    part = connected_parts(cells, len(points)) + 1
    return np.where(np.isin(part, part[open_edges(cells)]), 0, part)


def _single(cells: np.ndarray) -> np.ndarray:
    """(m,) whether a cell is kept: the first of doubled ones, or none where shells meet and stay as closed so."""
    keep = np.ones(len(cells), dtype=bool)
    keep[repeated(cells)] = False
    if cells.shape[1] == 3 and not keep.all():
        _, which, count = np.unique(np.sort(cells, axis=1), axis=0, return_inverse=True, return_counts=True)
        alone = count[which.ravel()] == 1
        if alone.any() and len(open_edges(cells[alone])) <= len(open_edges(cells[keep])):
            return alone
    return keep


def _solid(points: np.ndarray, cells: np.ndarray, regions: np.ndarray, name: str, done: list[str]) -> Solid:
    volumes, longest = simplex_volumes(points, cells), simplex_lengths(points, cells)
    thick = np.abs(volumes) > FLAT_SIMPLEX * longest ** points.shape[1]
    _say(done, (~thick).sum(), "{} flat cells dropped")
    cells, regions, volumes = cells[thick], regions[thick], volumes[thick]
    _check_left(cells, name)
    cells[volumes < 0, :2] = cells[volumes < 0, 1::-1]
    _say(done, (volumes < 0).sum(), "{} inverted cells turned")
    points, cells = drop_unused(points, cells)
    return Solid(points, cells.astype(np.int32), regions.astype(np.int32))


def _surface(points: np.ndarray, triangles: np.ndarray, hole: float, name: str, done: list[str]) -> Surface:
    triangles = _without_flat(points, triangles, done)
    _check_left(triangles, name)
    size = _diagonal(points)
    seam = near_seam(points, triangles, size)
    if seam and len(open_edges(triangles)) > len(triangles):
        raise MeshError(f"{name}: most of its triangles are not joined to others; {seam}")
    triangles = _oriented(triangles, name, done)
    points, triangles = _split(points, triangles, done)
    points, triangles, starts, rims = filled_holes(points, triangles)
    triangles = _without_sheets(points, triangles, name, done)
    rims = rims[np.isin(starts, triangles)]
    wide = rims[rims > hole * size] / size
    if len(wide):
        rim, them = ("a rim", "it") if len(wide) == 1 else (f"{len(wide)} rims", "them")
        raise MeshError(
            f"{name}: open along {rim} of up to {wide.max():.3g} diagonals, longer than --hole {hole:g};"
            f" {seam or f'--hole {np.ceil(100 * wide.max()) / 100:g} closes {them}'}"
        )
    _say(done, len(rims), "{} holes filled")
    points, triangles = drop_unused(points, _outward(points, triangles, done))
    return Surface(points, triangles.astype(np.int32))


def _without_sheets(points: np.ndarray, triangles: np.ndarray, name: str, done: list[str]) -> np.ndarray:
    """Triangles of closed shells without those of shells that enclose nothing; MeshError where these are no crumbs."""
    owner, first = shells(points, triangles)
    areas = facet_sizes(points, triangles)
    flat: np.ndarray = np.zeros(len(first), dtype=bool)
    for shell in range(len(first)):
        mine = owner == shell
        thickness = abs(enclosed_volume(points, triangles[mine])) / areas[mine].sum()
        flat[shell] = thickness <= SHEET * _diagonal(points[triangles[mine].ravel()])
    sheets = flat[owner]
    share = areas[sheets].sum() / areas.sum()
    if share > MOST_SHEETS:
        place = ", ".join(f"{x:.3g}" for x in points[triangles[sheets]].mean(axis=(0, 1)))
        remedy = "give it thickness" if flat.all() else "remove it, or give it thickness"
        part = "" if flat.all() else f" about ({place}), {100 * share:.2g} % of the surface,"
        raise MeshError(f"{name}: a sheet without thickness{part} encloses no volume; {remedy}")
    _say(done, flat.sum(), f"{{}} sheets that enclose nothing dropped, {100 * share:.2g} % of the area")
    return triangles[~sheets]


def _without_flat(points: np.ndarray, triangles: np.ndarray, done: list[str]) -> np.ndarray:
    """Triangles without area turned against the neighbour across their longest edge, or dropped."""
    turned, triangles = 0, triangles.copy()
    for _ in range(MOST_FLIPS):
        flat = flat_triangles(points, triangles)
        touched: set[int] = set()
        for t in flat:
            after = np.roll(triangles[t], -1)
            k = np.argmax(np.linalg.norm(points[after] - points[np.roll(after, -1)], axis=1))
            b, c, a = np.roll(triangles[t], -k)  # b lies on the edge from c to a
            pair = np.flatnonzero(np.isin(triangles, (a, c)).sum(axis=1) == 2)
            if len(pair) == 2 and touched.isdisjoint(pair):
                other = triangles[pair.sum() - t]
                d = other[~np.isin(other, (a, c))][0]
                triangles[pair] = (a, b, d), (b, c, d)
                touched.update(pair)
                turned += 1
        if not touched:
            break
    flat = flat_triangles(points, triangles)
    _say(done, turned, "{} triangles without area joined to their neighbours")
    _say(done, len(flat), "{} triangles without area dropped")
    return np.delete(triangles, flat, axis=0)


def _oriented(triangles: np.ndarray, name: str, done: list[str]) -> np.ndarray:
    """Neighbouring triangles turned the same way; each connected part as most of it is."""
    turned, part = igl.bfs_orient(np.ascontiguousarray(triangles))[:2]
    turned = np.asarray(turned, dtype=np.int64)
    if len(mixed_edges(turned)):
        raise MeshError(f"{name}: a part has one side only, as a Moebius strip, and no inside; cut or remove it")
    changed = (turned != triangles).any(axis=1)
    most = (np.bincount(part, changed) > np.bincount(part) / 2)[part]
    turned[most], changed = turned[most][:, ::-1], changed ^ most
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
    moved = places.copy()
    moved[copies] += PARTED * (middles - places)[copies]
    edges, crossed, _ = crossings_of(moved, split)  # of a cavity that meets its hull: both move the same way
    part = connected_parts(split, len(places))
    stay = np.isin(part, part[np.concatenate([edges.ravel(), split[crossed].ravel()])])
    moved[stay] = places[stay]
    return moved, split


def _outward(points: np.ndarray, triangles: np.ndarray, done: list[str]) -> np.ndarray:
    """Closed shells turned outward, cavities inward; those that touch or cross as walls may do are left as they are."""
    owner, first = shells(points, triangles)
    around = shells_around(points, triangles, owner, len(first)) != 0
    inward = np.array([enclosed_volume(points, triangles[owner == shell]) < 0 for shell in range(len(first))])
    depth, meet = around.sum(axis=1), np.zeros_like(around)
    if len(first) > 1:
        edges, crossed, _ = crossings_of(points, triangles)
        of_point: np.ndarray = np.zeros(len(points), dtype=np.int64)
        of_point[triangles] = owner[:, None]
        one, other = of_point[edges[:, 0]], owner[crossed]
        meet[one, other] = meet[other, one] = True
    unclear = (depth > 0) & (meet & (around | (inward[:, None] != inward))).any(axis=1)
    turned = ~unclear & (inward != (depth % 2 == 1))
    _say(done, turned.sum(), "{} shells turned inside out")
    triangles = triangles.copy()
    triangles[turned[owner]] = triangles[turned[owner]][:, ::-1]
    return triangles


def _uncrossed(surface: Surface, hole: float, envelope: float, name: str, done: list[str]) -> Surface:
    """The surface where it is sound; else a sound union of its shells, as they are or grown, within the envelope."""
    try:
        judge(surface, name)
        return surface
    except InputError as error:
        reason = error
    points, triangles = surface.vertices, surface.triangles.astype(np.int64)
    size = _diagonal(points)
    for grown in (0.0, 0.5 * envelope) if envelope > 0.0 else ():
        steps: list[str] = []
        try:
            owner, first = shells(points, triangles)
            distance: np.ndarray = np.zeros(len(points))  # one for each shell: what touches then crosses clearly
            distance[triangles] = grown * size * (owner[:, None] + 1) / len(first)
            moved = points + distance[:, None] * igl.per_vertex_normals(points, triangles)
            made, facets = in_child("libigl's union", united, moved, triangles, cpu_seconds=MESHER_SECONDS)
            _check_left(facets, name)
            made, facets, _ = _joined(*drop_unused(made, facets), max(COINCIDENT, SLIVER * grown) * size, None, steps)
            result = _surface(made, facets, hole, name, steps)
            judge(result, name)
            lost, added = deviation(points, triangles, result.vertices, result.triangles)
            whole, left = enclosed_volume(points, triangles), enclosed_volume(result.vertices, result.triangles)
            if not grown and abs(left - whole) <= UNCHANGED * whole:
                lost = 0.0  # only walls between two outsides are gone, as the lid of a cavity flush with the hull
            if max(lost, added) > envelope * size:
                what = "lose" if lost > added else "add"
                raise MeshError(
                    f"{name}: a union would {what} a part, {max(lost, added) / size:.2g} of its size away; a larger"
                    " --envelope allows it"
                )
            how = f"united, grown by up to {grown:g} of its size" if grown else "united"
            done.append(f"{how}: {len(triangles):,} triangles became {len(result.triangles):,}")
            done += [f"of the union, {step}" for step in steps]
            return result
        except InputError as error:
            reason = error
    done.append(f"nothing found that mends the rest ({reason})")
    return surface


def _comparison(before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray]) -> str:
    """A line that says how a boundary differs from what it was; of points (n, 3) [m] and cells (m, 3 or 4)."""
    counts, volumes, boundaries = [], [], []
    size = _diagonal(before[0][before[1].ravel()])
    for points, cells in (before, after):
        welded = coincident(points, COINCIDENT * size, _apart(points, cells))[cells]
        facets = boundary_facets(welded)[0] if cells.shape[1] == 4 else welded
        counts.append(len(shells(points, facets)[1]))
        volumes.append(np.nan)
        with suppress(InputError):
            check_manifold(facets, len(points), "")
            volumes[-1] = abs(enclosed_volume(points, facets))
        boundaries.append((points, facets))
    lost, added = deviation(*boundaries[0], *boundaries[1])
    found = ["shells {:,} -> {:,}".format(*counts)] if counts[0] != counts[1] else []
    if not abs(volumes[1] - volumes[0]) <= UNCHANGED * volumes[0]:
        found.append("volume " + " -> ".join("unknown" if np.isnan(v) else f"{v:.6g} m^3" for v in volumes))
    (low, high), (lower, higher) = (box_of(*boundary) for boundary in boundaries)
    for axis, a, b, c, d in zip("xyz", low, high, lower, higher, strict=True):
        if max(abs(c - a), abs(d - b)) > UNCHANGED * size:
            found.append(f"{axis} from {a:.4g} ... {b:.4g} m to {c:.4g} ... {d:.4g} m")
    if lost > UNCHANGED * size:
        found.append(f"the given surface lies up to {lost / size:.2g} of its size outside")
    if added > UNCHANGED * size:
        found.append(f"the new one up to {added / size:.2g} of its size off the given one")
    return "compared with the input: " + (", ".join(found) or "the same shells, volume, box and surface")
