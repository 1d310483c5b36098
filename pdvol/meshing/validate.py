"""Checks of one shape before it is used. Every error is one line that names the primitives and what to do."""

import igl
import numpy as np

from pdvol.errors import IntersectionError, InvertedCellError, MeshError
from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.crossings import counted_edges, edges_of, find_crossings, find_touching
from pdvol.geometry.distances import distances_to
from pdvol.geometry.level_mesh import connected_parts, facet_sizes, simplex_volumes
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.cpu_budget import check_budget
from pdvol.meshing.weld import COINCIDENT, open_edges, seam_vertices

FLAT_SIMPLEX = 1e-12
"""Measure (length, area, volume) of a simplex, relative to its longest edge to that power, below which it is flat."""
FLAT_BODY = 1e-12
"""Volume of a closed surface, relative to its area times its diagonal, below which it encloses nothing."""
MOST_SHELLS = 300
"""Shells of a surface that are looked at for one inside another: with more it takes minutes."""
LARGE_SURFACE, SAMPLE = 20_000, 500
"""Triangles of a surface above which crossings are sought in a sample first, and how many it has."""
PLACES_SEEN = 500
"""Vertices, and middles of triangles, of a shell that are looked at for whether it lies inside another one."""


def some(indices: np.ndarray, shown: int = 5) -> str:
    """The first few of many indices, for a message."""
    listed = ", ".join(str(tuple(int(k) for k in i) if np.ndim(i) else int(i)) for i in indices[:shown])
    return listed + (f" and {len(indices) - shown} more" if len(indices) > shown else "")


def _check_arrays(
    name: str, points: np.ndarray, cells: np.ndarray, kind: str, dims: tuple[int, ...]
) -> tuple[np.ndarray, np.ndarray]:
    points, cells = np.asarray(points, dtype=np.float64), np.asarray(cells)
    if points.ndim != 2 or points.shape[1] not in dims or cells.ndim != 2:
        shapes = f"points of shape {points.shape} and {kind} of shape {cells.shape}"
        raise MeshError(f"{name}: {shapes} do not fit; use (n, {dims[0]}) and 2D indices")
    if len(cells) == 0 or len(points) == 0:
        raise MeshError(f"{name}: the mesh is empty; give one with {kind}")
    if not np.issubdtype(cells.dtype, np.integer):
        raise MeshError(f"{name}: the {kind} are not whole numbers; give integer vertex indices")
    cells = cells.astype(np.int64)
    outside = np.flatnonzero((cells < 0).any(axis=1) | (cells >= len(points)).any(axis=1))
    if len(outside):
        raise MeshError(
            f"{name}: {kind} {some(outside)} use vertices that do not exist (there are {len(points)}); export the mesh"
            " again"
        )
    broken = np.flatnonzero(~np.isfinite(points).all(axis=1))
    if len(broken):
        raise MeshError(f"{name}: vertices {some(broken)} have NaN or infinite coordinates; export the mesh again")
    return points, cells


def drop_unused(points: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The points that belong to a cell, in their order, and the cells renumbered."""
    used, index = np.unique(cells, return_inverse=True)
    return np.ascontiguousarray(points[used]), index.reshape(cells.shape).astype(np.int64)


def repeated(cells: np.ndarray) -> np.ndarray:
    """Indices of the cells that repeat an earlier one."""
    _, first = np.unique(np.sort(cells, axis=1), axis=0, return_index=True)
    return np.setdiff1d(np.arange(len(cells)), first)


def simplex_lengths(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """(m,) the longest edge [m] of each simplex."""
    corners = points[cells]
    steps = range(1, cells.shape[1] // 2 + 1)
    return np.max([np.linalg.norm(corners - np.roll(corners, k, axis=1), axis=2).max(axis=1) for k in steps], axis=0)


def flat_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Indices of the triangles without area."""
    areas = 2.0 * facet_sizes(points, triangles)
    return np.flatnonzero(areas <= FLAT_SIMPLEX * simplex_lengths(points, triangles) ** 2)


def crossings_of(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, str]:
    """Edges (k, 2) that cross a facet, as vertices, and the index (k,) of that facet; with a remark for messages.

    Facets are triangles or segments. Of a large surface some triangles are looked at first: where everything overlaps
    everything, pairs do not fit into memory.
    """
    faces = facets if facets.shape[1] == 3 else facets[:, :0]
    tries: list[np.ndarray] = [np.arange(len(facets))]
    if len(facets) > LARGE_SURFACE:
        tries.insert(0, np.sort(np.random.default_rng(0).choice(len(facets), SAMPLE, replace=False)))
    for chosen in tries:
        edges = edges_of(facets[chosen])
        pairs = find_crossings(points, edges, faces[chosen])
        if len(pairs):
            break
    sample = f", in a sample of {SAMPLE:,}" if len(chosen) < len(facets) else ""
    return edges[pairs[:, 0]], chosen[pairs[:, 1]], sample


def _check_crossings(points: np.ndarray, facets: np.ndarray, name: str, what: str, remedy: str) -> None:
    """Raise IntersectionError where facets, triangles or segments, cross or touch themselves."""
    edges, crossed, sample = crossings_of(points, facets)
    if len(edges):
        owner = np.flatnonzero(np.isin(facets, edges[0]).sum(axis=1) == 2)[0]
        kind = "triangles" if facets.shape[1] == 3 else "segments"
        raise IntersectionError(
            f"{name}: {kind} {owner} and {crossed[0]} cross{sample} ({len(edges)} crossings); {remedy}",
            zip(edges.tolist(), crossed.tolist(), strict=True),
            corners=[c for e, f in zip(edges, crossed, strict=True) for c in (points[e], points[facets[f]])],
        )
    touching = find_touching(points, edges_of(facets), facets[:, :0] if facets.shape[1] == 2 else facets)
    if len(touching):
        raise IntersectionError(
            f"{name}: {what} touches itself at vertices {touching[0, 0]} and {touching[0, 1]} ({len(touching)}"
            f" crossings); {remedy}",
            touching.tolist(),
            corners=list(points[touching.ravel(), None]),
        )


def mixed_edges(triangles: np.ndarray) -> np.ndarray:
    """Edges (e, 2) of two triangles that disagree on what is outside."""
    corners = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    edges, which, counts = counted_edges(triangles)
    turns = np.bincount(which, weights=np.where(corners[:, 0] < corners[:, 1], 1, -1))
    return edges[(counts == 2) & (turns != 0)]


def check_manifold(triangles: np.ndarray, n: int, name: str, closed: bool = True) -> None:
    """Raise MeshError unless the triangles form a closed, consistently oriented 2-manifold."""
    edges, _, counts = counted_edges(triangles)
    if (counts > 2).any():
        heavy = some(edges[counts > 2])
        raise MeshError(
            f"{name}: edges {heavy} have more than two triangles (non-manifold); remove the inner or doubled walls"
        )
    if closed and (counts == 1).any():
        raise MeshError(
            f"{name}: the surface is open along {int((counts == 1).sum())} edges, {some(edges[counts == 1])};"
            " close the holes, as pdvol repair does"
        )
    mixed = mixed_edges(triangles)
    if len(mixed):
        raise MeshError(
            f"{name}: triangles disagree on what is outside across edges {some(mixed)}; recalculate the normals outward"
        )
    fans = igl.is_vertex_manifold(np.ascontiguousarray(triangles, dtype=np.int64))
    pinched = np.intersect1d(np.flatnonzero(~fans), triangles)
    if len(pinched):
        raise MeshError(
            f"{name}: parts meet in the single vertices {some(pinched)} (non-manifold); split or merge them there"
        )


def check_surface(surface: Surface, name: str = "surface", closed: bool = True) -> Surface:
    """The surface made fit to be meshed: unused vertices dropped, a shell turned wholly inside out turned back. Open
    edges are an error where it must be `closed`.

    Raises
    ------
    MeshError
        NaN coordinates, indices out of range, degenerate or duplicate triangles, open or non-manifold edges, pinched
        vertices, mixed orientation.
    IntersectionError
        The surface crosses or touches itself.
    """
    points, triangles = _check_arrays(name, surface.vertices, surface.triangles, "triangles", (3,))
    flat = flat_triangles(points, triangles)
    if len(flat):
        raise MeshError(f"{name}: triangles {some(flat)} have no area; merge or remove their vertices")
    doubled = repeated(triangles)
    if len(doubled):
        raise MeshError(f"{name}: triangles {some(doubled)} repeat others; remove them, as pdvol repair does")
    seams = seam_vertices(points, triangles) if closed else 0
    if seams:
        raise MeshError(
            f"{name}: weld: {seams} vertices coincide within {COINCIDENT:g} of its size, and the surface is open along"
            f" {len(open_edges(triangles))} edges; weld them, as pdvol repair does"
        )
    check_manifold(triangles, len(points), name, closed)
    points, triangles = drop_unused(points, triangles)
    if closed:
        volume, area = enclosed_volume(points, triangles), facet_sizes(points, triangles).sum()
        if abs(volume) <= FLAT_BODY * area * np.linalg.norm(np.ptp(points, axis=0)):
            raise MeshError(f"{name}: the surface encloses no volume; give a body with an inside")
        triangles = triangles[:, ::-1] if volume < 0 else triangles
    check_budget(name)
    _check_crossings(points, triangles, name, "the surface", "repair the self-intersections, as pdvol repair does")
    check_budget(name)
    if closed:
        check_nested(points, triangles.astype(np.int64), name)
    return Surface(points, np.ascontiguousarray(triangles, dtype=np.int32))


def shells(points: np.ndarray, triangles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(m,) the shell 0 ... k - 1 of each triangle, and (k,) the first triangle of each shell."""
    _, first, owner = np.unique(
        connected_parts(triangles, len(points))[triangles[:, 0]], return_index=True, return_inverse=True
    )
    return owner.ravel(), first


def shells_around(points: np.ndarray, triangles: np.ndarray, owner: np.ndarray, count: int) -> np.ndarray:
    """(k, k) the winding number of each shell (column) about each other one (row) that lies wholly inside it; else 0.

    Places of a shell that lie on another one, where the two touch, do not count.
    """
    whose, places = [], []
    for shell in range(count):
        mine = triangles[owner == shell]
        for seen in (points[np.unique(mine)], points[mine].mean(axis=1)):
            places.append(seen[np.linspace(0, len(seen) - 1, min(len(seen), PLACES_SEEN)).astype(np.int64)])
            whose.append(np.full(len(places[-1]), shell))
    at, of = np.concatenate(places), np.concatenate(whose)
    found: np.ndarray = np.zeros((count, count))
    for shell in range(count):
        corners, local = drop_unused(points, triangles[owner == shell])
        near = ((at >= corners.min(axis=0)) & (at <= corners.max(axis=0))).all(axis=1)
        near &= ~np.isin(of, of[~near])  # a shell that leaves the box lies outside
        if not near[of != shell].any():
            continue
        near &= of != shell
        seen, mine = np.ascontiguousarray(at[near]), of[near]
        around = np.round(igl.winding_number(corners, local, seen))
        clear = distances_to(seen, corners, local) > COINCIDENT * np.linalg.norm(np.ptp(corners, axis=0))
        clear &= ~np.isin(mine, mine[clear & (around == 0)])
        found[mine[clear], shell] = around[clear]
    return found


def check_nested(points: np.ndarray, triangles: np.ndarray, name: str) -> None:
    """Raise IntersectionError where a shell lies inside another one and is no cavity of it, or bounds no body."""
    owner, first = shells(points, triangles)
    if not 1 < len(first) <= MOST_SHELLS:
        return
    around = shells_around(points, triangles, owner, len(first)).sum(axis=1)
    for shell, (start, deep) in enumerate(zip(first, around, strict=True)):
        if deep != (enclosed_volume(points, triangles[owner == shell]) < 0.0):
            vertex = int(triangles[start, 0])
            what = (
                "lies inside another one, so that two bodies overlap; remove it, or turn it inward for a cavity"
                if deep > 0
                else "faces inward, and lies inside no other; turn it outward"
            )
            corners = list(points[triangles[owner == shell]])
            raise IntersectionError(f"{name}: the shell of vertex {vertex} {what}", [(vertex,)], corners=corners)


def check_outline(outline: Outline, name: str = "outline", closed: bool = True) -> Outline:
    """The outline, anticlockwise where it is closed. It raises MeshError for too few points, NaN coordinates or a
    repeated point, and IntersectionError where it crosses or touches itself.
    """
    points = np.asarray(outline.points, dtype=np.float64)
    n, least = len(points), 3 if closed else 2
    if points.ndim != 2 or points.shape[1] != 2 or n < least:
        raise MeshError(
            f"{name}: points of shape {points.shape} make no outline; give at least {least} points of 2 coordinates"
        )
    segments = outline_edges(n, closed)
    points, segments = _check_arrays(name, points, segments, "segments", (2,))
    lengths = np.linalg.norm(points[segments[:, 1]] - points[segments[:, 0]], axis=1)
    short = np.flatnonzero(lengths <= FLAT_SIMPLEX * np.linalg.norm(np.ptp(points, axis=0)))
    if len(short):
        mend = "remove the repeated points (the first is not repeated at the end)"
        raise MeshError(f"{name}: segments {some(short)} have no length; {mend}")
    _check_crossings(points, segments, name, "the outline", "untangle the outline")
    if closed and signed_area(points) < 0:
        points = points[::-1]
    return Outline(np.ascontiguousarray(points))


def outline_edges(n: int, closed: bool) -> np.ndarray:
    """Segments (e, 2) int64 joining `n` points in order."""
    edges = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    return edges if closed else edges[:-1]


def signed_area(points: np.ndarray) -> float:
    """Area [m^2] inside a polygon (n, 2), negative where it runs clockwise."""
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def check_solid(solid: Solid, name: str = "mesh") -> Solid:
    """The solid with its unused vertices dropped and, if all its cells are numbered the other way round, turned.

    It raises InvertedCellError for inverted or flat cells, which `cells` names, and MeshError for NaN coordinates,
    indices out of range or duplicate cells.
    """
    points, cells = _check_arrays(name, solid.vertices, solid.cells, "cells", (2, 3))
    dim = points.shape[1]
    if cells.shape[1] != dim + 1:
        raise MeshError(
            f"{name}: cells of {cells.shape[1]} vertices in {dim}D; give {'triangles' if dim == 2 else 'tetrahedra'}"
        )
    regions = np.asarray(solid.regions)
    if regions.shape != (len(cells),):
        raise MeshError(f"{name}: {regions.shape} region labels for {len(cells)} cells; give one a cell")
    doubled = repeated(cells)
    if len(doubled):
        raise MeshError(f"{name}: cells {some(doubled)} repeat others; remove the duplicates")
    volumes = simplex_volumes(points, cells)
    flat = np.flatnonzero(np.abs(volumes) <= FLAT_SIMPLEX * simplex_lengths(points, cells) ** dim)
    if len(flat):
        raise InvertedCellError(f"{name}: cells {some(flat)} are flat; mesh the shape again", flat)
    inverted = np.flatnonzero(volumes < 0)
    if 0 < len(inverted) < len(cells):
        many = f"{len(inverted)} of {len(cells)}"
        raise InvertedCellError(
            f"{name}: cells {some(inverted)} are inverted ({many}); renumber or mesh again", inverted
        )
    if len(inverted):  # another convention of numbering, not a fault of the shape
        cells = cells[:, [1, 0, *range(2, dim + 1)]]
    points, cells = drop_unused(points, cells)
    return Solid(points, cells.astype(np.int32), regions.astype(np.int32))
