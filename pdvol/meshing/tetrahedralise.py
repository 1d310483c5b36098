"""Tetrahedra inside a closed surface, with a given number of vertices: fTetWild, or TetGen where the boundary must stay
as it is.
"""

import importlib.util
from itertools import combinations

import numpy as np

from pdvol.errors import InputError, MeshError
from pdvol.geometry.level_mesh import boundary_facets, simplex_volumes
from pdvol.meshes import Surface
from pdvol.meshing.decimate import MIN_SURFACE_VERTICES, topology
from pdvol.meshing.edge_length import SizedMesh, edge_length, expected_vertices, mesh_of_target_size
from pdvol.meshing.mesher_process import run_worker
from pdvol.meshing.validate import check_surface, drop_unused, shells

ENVELOPE_WIDTH = 0.1
"""Distance that fTetWild may move the surface, relative to the edge length: less takes minutes and prevents coarse
boundaries.
"""
MIN_QUALITY = 0.02
"""Mean-ratio quality of a mesh's worst cell below which it is refused; fTetWild's worst cells have about 0.35."""


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
    """Number of vertices that the surface of a mesh of `target` vertices should have: the expected number and a fifth
    more, for finer features.
    """
    volume, area = measure(surface)
    return min(
        max(int(1.2 * expected_vertices(edge_length(target, volume, area, 3), volume, area, 3)[0]), 12), max(target, 12)
    )


def tetrahedralise(surface: Surface, target: int, name: str = "surface", keep_boundary: bool = False) -> SizedMesh:
    """A tetrahedral mesh of about `target` vertices (see `edge_length`).

    Its boundary is a valid surface with the shells and handles of the given one.

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
        No such mesh was found within `MAX_ATTEMPTS`, or TetGen is not installed.
    """
    volume, area = measure(surface)
    if volume <= 0:
        raise MeshError(f"{name}: the surface encloses no volume; turn its triangles outward")
    if keep_boundary and importlib.util.find_spec("tetgen") is None:
        raise MeshError(
            f"{name}: keeping the boundary needs TetGen (AGPL), which is not installed; run pip install tetgen"
        )
    h = edge_length(target, volume, area, 3)
    parts = split_shells(surface)
    if len(parts) > 1:
        # fTetWild also meshes the space between parts and refines where they are near each other: meshing them one by
        # one avoids both.
        shares = [max(round(expected_vertices(h, *measure(part), 3)[1]), MIN_SURFACE_VERTICES) for part in parts]
        return _merged(
            [tetrahedralise(part, share, name, keep_boundary) for part, share in zip(parts, shares, strict=True)]
        )
    # fTetWild refines curved and thin parts, relatively more in coarser meshes: measured on the shapes spot, goathead
    # and torus.
    start = 1.0 if keep_boundary else 1.0 + 12.0 / np.sqrt(target)
    diagonal = float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))
    wanted = topology(surface.triangles, len(surface.vertices))
    timeout = 60.0 + 0.04 * (target + len(surface.vertices))
    envelope = np.inf

    def make(scale: float, failures: int) -> tuple[np.ndarray, np.ndarray]:
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
        epsilon = min(ENVELOPE_WIDTH * scale * h, envelope) / diagonal
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
            # Parts closer than two envelopes merge: all later attempts use a tighter envelope than the failed one.
            envelope = 0.5 * epsilon * diagonal
            raise

    return mesh_of_target_size(make, target, name, start, 3)


def split_shells(surface: Surface) -> list[Surface]:
    """The shells of a surface, each on its own; the whole surface where some shell is a cavity of another."""
    owner = shells(surface.triangles, len(surface.vertices))
    parts = []
    for shell in np.unique(owner[surface.triangles[:, 0]]):
        points, triangles = drop_unused(surface.vertices, surface.triangles[owner[surface.triangles[:, 0]] == shell])
        parts.append(Surface(points, triangles.astype(np.int32)))
    return parts if all(measure(part)[0] > 0 for part in parts) else [surface]


def _merged(meshes: list[SizedMesh]) -> SizedMesh:
    """Several meshes in one set of arrays. Their boundaries have moved by less than an envelope each;
    `levels.initial_state` finds out if they then cross.
    """
    starts = np.cumsum([0, *(len(m.points) for m in meshes)])
    cells = np.vstack([m.cells + start for m, start in zip(meshes, starts, strict=False)])
    return SizedMesh(np.vstack([m.points for m in meshes]), cells, meshes[0].scale)


def _checked(
    points: np.ndarray, cells: np.ndarray, wanted: tuple[int, int], name: str, strict: bool
) -> tuple[np.ndarray, np.ndarray]:
    """The mesh turned positive and without unused points; MeshError where it is not a valid solid with the wanted
    topology.
    """
    if len(cells) == 0:
        raise MeshError(f"{name}: the mesher returned no cells")
    points, cells = drop_unused(np.asarray(points, dtype=np.float64), np.asarray(cells, dtype=np.int64))
    negative = simplex_volumes(points, cells) < 0
    cells[negative] = cells[negative][:, [1, 0, 2, 3]]
    worst = float(mean_ratio(points, cells).min())
    if worst < MIN_QUALITY:
        raise MeshError(f"{name}: the worst cell has quality {worst:.2g}")
    facets, _ = boundary_facets(cells)
    boundary, triangles = drop_unused(points, facets)
    try:
        check_surface(Surface(boundary, triangles), f"{name}, meshed")
    except InputError as error:
        raise MeshError(str(error)) from error
    count, euler = topology(triangles, len(boundary))
    # The smallest handles of a noisy scan are lost in coarsening: after enough failures only the number of shells must
    # agree.
    if count != wanted[0] or (strict and euler != wanted[1]):
        raise MeshError(
            f"{name}: the mesh has {count} shells and Euler number {euler} where the surface has {wanted[0]} and"
            f" {wanted[1]}"
        )
    return points, cells
