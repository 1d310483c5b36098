"""Tetrahedra of one edge length inside a surface that Gmsh meshes anew: flat faces, sharp edges and corners of the
input stay exactly, and cells are good.

It suits solids without detail finer than an edge. Other surfaces are decimated, and meshed by `tetrahedralise`.
"""

import numpy as np

from pdvol.errors import MeshError
from pdvol.geometry.distances import distances_to
from pdvol.geometry.flat_faces import SHARP_ANGLE, FlatFaces, neighbours, unit_normals
from pdvol.geometry.level_mesh import boundary_facets, facet_sizes
from pdvol.meshes import Surface
from pdvol.meshing.child_process import in_child
from pdvol.meshing.cpu_budget import BudgetSpent, ProcessStopped
from pdvol.meshing.decimate import topology
from pdvol.meshing.edge_length import BASE_CPU_SECONDS, SizedMesh, edge_length, mesh_of_target_size
from pdvol.meshing.meshers import Mesh, gmsh_tetrahedra
from pdvol.meshing.tetrahedralise import in_parts, oriented, volume_and_area, with_volume_checked

SMOOTH = 1.2
"""Curvature of a surface [1 / edge length], outside of its sharp edges, up to which it is meshed so. A ball of 100
vertices has 0.5; animals of 1,000 have 1.2 to 3 somewhere, and lose an ear or a foot."""
MOSTLY_FLAT = 0.5
"""Part of a surface's area in flat faces from which its curvature does not count: the rest are fillets and bores, which
keep their borders.
"""
LEFT_OUT = 0.02
"""Part of a surface's area whose curvature does not count: single facets of an input that was not made evenly."""
MISSED = 0.5
"""Distance of the input's vertices from the mesh, relative to its edges, above which they are detail that is lost: a
corner rounded over one edge length is 0.42.
"""
FAR_FROM_ASKED = 0.5
"""Relative deviation of the number of vertices from the target above which decimation is tried: it drops features."""
LEAST_QUALITY = 0.1
"""Mean-ratio quality of the worst cell: mostly 0.2 to 0.5, less where the input's own edges are short."""

SPARE_TRIES = 2
"""Meshes in a row that may be invalid before decimation is tried."""


class Unsuited(Exception):
    """A surface that cannot be meshed so; the message says why."""


def remesh(surface: Surface, target: int, name: str = "surface") -> SizedMesh:
    """A tetrahedral mesh of about `target` vertices, with the volume, the flat faces and the sharp edges of a valid
    surface.

    It raises Unsuited where a part of the surface cannot be parametrised, has detail finer than an edge, or gives poor
    cells; UnreachableCount and MeshError as `tetrahedralise`.
    """
    return in_parts(_remeshed, surface, target, name)


def _remeshed(surface: Surface, target: int, name: str) -> SizedMesh:
    volume, area = volume_and_area(surface)
    size, centre = volume ** (1.0 / 3.0), surface.vertices.mean(axis=0)
    unit = (surface.vertices - centre) / size
    h = edge_length(target, volume, area, 3) / size
    flat = FlatFaces(unit, surface.triangles)
    given = unit, surface.triangles.astype(np.int64), flat.patches()
    wanted = topology(surface.triangles, len(unit))
    flat_area = facet_sizes(unit, surface.triangles[flat.of_facets >= 0]).sum()
    if flat_area < MOSTLY_FLAT * area / size**2 and (bends := curvature(unit, surface.triangles) * h) > SMOOTH:
        raise Unsuited(f"{name}: it is round by {bends:.2f} rad an edge")

    def make(scale: float, failures: int) -> SizedMesh:
        try:
            made: Mesh = in_child("Gmsh", gmsh_tetrahedra, *given, scale * h, SHARP_ANGLE, cpu_seconds=BASE_CPU_SECONDS)
            points, cells = oriented(*made, name)
            missed = float(distances_to(unit, points, boundary_facets(cells)[0]).max())
            if missed > MISSED * scale * h:
                raise Unsuited(f"{name}: detail of {missed / (scale * h):.2f} edges is lost")
            return with_volume_checked(points, cells, 1.0, flat, wanted, LEAST_QUALITY, name)
        except BudgetSpent:
            raise
        except (MeshError, ProcessStopped) as error:
            if isinstance(error, ProcessStopped) or failures == SPARE_TRIES:
                raise Unsuited(str(error)) from error
            raise  # a somewhat shorter edge gives other cells

    made = mesh_of_target_size(make, target, name, 0.79 + 5.0 / np.sqrt(target), 3)
    if abs(len(made.points) / target - 1.0) > FAR_FROM_ASKED:
        raise Unsuited(f"{name}: its features take {len(made.points)} vertices")
    return made.placed(centre, size)


def curvature(points: np.ndarray, triangles: np.ndarray) -> float:
    """[1/m] the largest curvature of a surface, but on `LEFT_OUT` of its area and across sharp edges: the angle between
    two triangles (m, 3) over the distance of their centres from their edge.
    """
    pairs = neighbours(triangles)
    normals, sizes = unit_normals(points, triangles), facet_sizes(points, triangles)
    first, second = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    shared = first[(first[:, :, None] == second[:, None]).any(axis=2)].reshape(-1, 2)
    lengths = np.linalg.norm(points[shared[:, 0]] - points[shared[:, 1]], axis=1)
    areas = sizes[pairs].sum(axis=1)
    angles = np.arccos(np.clip((normals[pairs[:, 0]] * normals[pairs[:, 1]]).sum(axis=1), -1.0, 1.0))
    angles[angles > SHARP_ANGLE] = 0.0
    bends = 1.5 * angles * lengths / areas
    order = np.argsort(bends)
    return float(bends[order][np.searchsorted(np.cumsum(areas[order]) / areas.sum(), 1.0 - LEFT_OUT)])
