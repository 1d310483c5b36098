"""Tetrahedra inside a closed surface, with a given number of vertices: fTetWild, or TetGen where the boundary must stay
as it is.
"""

import importlib.util
from itertools import combinations

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshes import Surface
from pdvol.meshing.decimate import SMALLEST, topology
from pdvol.meshing.edge_length import Sized, edge_length, expected_vertices, home_in
from pdvol.meshing.mesher_process import run_worker
from pdvol.meshing.validate import check_surface, drop_unused, shells

ENVELOPE = 0.1
"""fTetWild may move the surface by this fraction of the edge length: a tighter envelope costs minutes and forbids
coarse boundaries.
"""
LOWEST_QUALITY = 0.02
"""Mean-ratio quality below which a mesh is refused; fTetWild's worst are near 0.35."""


def mean_ratio(points: np.ndarray, cells: np.ndarray) -> np.ndarray:
    """Quality (m,) of simplices: 1 for an equilateral one, 0 for a flat one (2D and 3D)."""
    d = points.shape[1]
    squares = sum(
        ((points[cells[:, i]] - points[cells[:, j]]) ** 2).sum(axis=1) for i, j in combinations(range(d + 1), 2)
    )
    volumes = np.maximum(simplex_volumes(points, cells), 0.0)
    return 4.0 * np.sqrt(3.0) * volumes / squares if d == 2 else 12.0 * (3.0 * volumes) ** (2.0 / 3.0) / squares


def measure(surface: Surface) -> tuple[float, float]:
    """Volume [m^3] and area [m^2] of a closed surface."""
    a, b, c = (surface.vertices[surface.triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    return float(np.einsum("ij,ij->", a, normals)) / 6.0, float(np.linalg.norm(normals, axis=1).sum()) / 2.0


def surface_share(surface: Surface, target: int) -> int:
    """How many of `target` vertices the surface should be decimated to: its expected share, and some to spare for its
    finer features.
    """
    volume, area = measure(surface)
    return min(
        max(int(1.2 * expected_vertices(edge_length(target, volume, area, 3), volume, area, 3)[0]), 12), max(target, 12)
    )


def tetrahedralise(surface: Surface, target: int, name: str = "surface", keep_boundary: bool = False) -> Sized:
    """A tetrahedral mesh of about `target` vertices (see `sizing`), its boundary a valid surface with the given one's
    shells and handles.

    Parameters
    ----------
    surface : Surface
        Valid (`check_surface`); its own number of vertices should not be far above the expected boundary's.
    target : int
    name : str, for messages
    keep_boundary : bool
        Keep every triangle of the surface, with TetGen (an optional extra: `pip install pdvol[tetgen]`).

    Raises
    ------
    MeshError
        No such mesh was found within the bounded number of tries, or TetGen is not installed.
    """
    volume, area = measure(surface)
    if volume <= 0:
        raise MeshError(f"{name}: the surface encloses no volume; turn its triangles outward")
    if keep_boundary and importlib.util.find_spec("tetgen") is None:
        raise MeshError(
            f"{name}: keeping the boundary needs TetGen (AGPL), which is not installed; run pip install tetgen"
        )
    h = edge_length(target, volume, area, 3)
    parts = separate(surface)
    if len(parts) > 1:
        # fTetWild also meshes the space between, and refines where parts are near each other: apart, they cost nothing
        # more.
        shares = [max(round(expected_vertices(h, *measure(part), 3)[1]), SMALLEST) for part in parts]
        return _merged(
            [tetrahedralise(part, share, name, keep_boundary) for part, share in zip(parts, shares, strict=True)]
        )
    # fTetWild refines towards curved and thin parts, the more the coarser the mesh: measured on spot, goathead and
    # torus.
    start = 1.0 if keep_boundary else 1.0 + 12.0 / np.sqrt(target)
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    wanted = topology(surface.triangles, len(surface.vertices))
    timeout = 60.0 + 0.04 * (target + len(surface.vertices))
    envelope = np.inf

    def make(scale: float, failures: int):
        nonlocal envelope
        given = {"vertices": surface.vertices, "triangles": surface.triangles}
        if keep_boundary:
            made = run_worker(
                "tet_worker.py",
                timeout,
                mesher=np.array("tetgen"),
                max_volume=np.array(0.2 * (scale * h) ** 3),
                **given,
            )
            return _checked(made["points"], made["cells"], wanted, name, strict=True)
        epsilon = min(ENVELOPE * scale * h, envelope) / diagonal
        try:
            made = run_worker(
                "tet_worker.py",
                timeout,
                mesher=np.array("ftetwild"),
                edge_length=np.array(scale * h),
                epsilon=np.array(epsilon),
                **given,
            )
            return _checked(made["points"], made["cells"], wanted, name, strict=failures < 3)
        except InputError:
            # Parts closer than two envelopes merge: whatever comes later must stay tighter than what failed.
            envelope = 0.5 * epsilon * diagonal
            raise

    return home_in(make, target, name, start, 3)


def separate(surface: Surface) -> list[Surface]:
    """The shells of a surface, each on its own; the whole surface where some shell is a cavity of another."""
    owner = shells(surface.triangles, len(surface.vertices))
    parts = []
    for shell in np.unique(owner[surface.triangles[:, 0]]):
        points, triangles = drop_unused(surface.vertices, surface.triangles[owner[surface.triangles[:, 0]] == shell])
        parts.append(Surface(points, triangles.astype(np.int32)))
    return parts if all(measure(part)[0] > 0 for part in parts) else [surface]


def _merged(meshes: list[Sized]) -> Sized:
    """Several meshes in one set of arrays. Their boundaries moved by less than an envelope each; `start_check` tells if
    they then cross.
    """
    starts = np.cumsum([0, *(len(m.points) for m in meshes)])
    cells = np.vstack([m.cells + start for m, start in zip(meshes, starts, strict=False)])
    return Sized(np.vstack([m.points for m in meshes]), cells, meshes[0].scale)


def _checked(points: np.ndarray, cells: np.ndarray, wanted: tuple[int, int], name: str, strict: bool):
    """The mesh turned positive and without unused points; MeshError where it is not a valid solid with the wanted
    topology.
    """
    if len(cells) == 0:
        raise MeshError(f"{name}: the mesher returned no cells")
    points, cells = drop_unused(np.asarray(points, dtype=np.float64), np.asarray(cells, dtype=np.int64))
    negative = simplex_volumes(points, cells) < 0
    cells[negative] = cells[negative][:, [1, 0, 2, 3]]
    worst = float(mean_ratio(points, cells).min())
    if worst < LOWEST_QUALITY:
        raise MeshError(f"{name}: the worst cell has quality {worst:.2g}")
    facets, _ = boundary_facets(cells)
    boundary, triangles = drop_unused(points, facets)
    try:
        check_surface(Surface(boundary, triangles), f"{name}, meshed")
    except InputError as error:
        raise MeshError(str(error)) from error
    count, euler = topology(triangles, len(boundary))
    # A noisy scan's tiniest handles do not survive coarsening: after enough failures only the number of parts must
    # agree.
    if count != wanted[0] or (strict and euler != wanted[1]):
        raise MeshError(
            f"{name}: the mesh has {count} shells and Euler number {euler} where the surface has {wanted[0]} and"
            f" {wanted[1]}"
        )
    return points, cells
