"""The libraries that make meshes, to be called in a process of their own (`child_process.py`).

Little is imported here, as each of these processes imports it.
"""

import ctypes
import os
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import numpy as np

from pdvol.meshing.child_process import Child

STOP_ENERGY = 20.0
"""AMIPS energy of the worst cell at which fTetWild stops: 3 divided by the mean ratio, so 0.15. Its default of 10 takes
up to four times as long and adds vertices at sharp edges.
"""
MOST_PASSES = 3
"""Passes over the mesh after which it stops, too. Later ones improve few cells, and each goes over the whole box around
the shape, with up to ten times as many vertices as inside.
"""
# C source of a std::random_device that returns the same linear congruential sequence in every process. fTetWild
# shuffles with a std::mt19937 that std::random_device seeds, so without it the same input would give a different mesh
# each time. The library is preloaded in the mesher's process. The Itanium C++ ABI fixes the symbol's name in libstdc++.
_SEEDED_RANDOM_DEVICE = """
unsigned int _ZNSt13random_device9_M_getvalEv(void *self)
{
    static unsigned int state = 1u;
    (void)self;
    return state = state * 1664525u + 1013904223u;
}
"""
_LINE, _TRIANGLE, _TETRAHEDRON = 1, 2, 4
"""Gmsh's numbers of these kinds of cells."""
Mesh = tuple[np.ndarray, np.ndarray]


def ftetwild(
    vertices: np.ndarray, triangles: np.ndarray, edge_length: float, epsilon: float, cpu_seconds: float
) -> Mesh:
    """Points (n, 3) and tetrahedra (m, 4), of either orientation, of fTetWild's mesh inside a surface of vertices (k,
    3) [m] and triangles (t, 3).

    It takes an edge length [m], the distance `epsilon` that the surface may move, relative to its diagonal, and the
    processor time [s] that the process may use. It raises as `Child.call`, and InputError where no C compiler works.
    """
    from pdvol.compiled import kept

    linux = sys.platform.startswith("linux")
    library = kept("fixed-random-1", "compiling C code", _seeded_random_device) if linux else None
    with tempfile.TemporaryDirectory(prefix="pdvol-mesh-") as folder, Child(library) as child:
        given = vertices, triangles.astype(np.int32), float(edge_length), float(epsilon), folder
        return child.call("fTetWild", _ftetwild, *given, cpu_seconds=cpu_seconds)


def _ftetwild(vertices: np.ndarray, triangles: np.ndarray, edge_length: float, epsilon: float, folder: str) -> Mesh:
    os.chdir(folder)  # it leaves a file where it works
    # pytetwild adds itself to pyvista where that can be extended. Importing pyvista takes longer than a coarse mesh.
    sys.modules.setdefault("pyvista", ModuleType("pyvista"))
    import pytetwild

    # One processor, since the order of fTetWild's threads changes the mesh. The present one: two meshers then use two.
    os.sched_setaffinity(0, {ctypes.CDLL(None).sched_getcpu()})
    return pytetwild.tetrahedralize(
        vertices,
        triangles,
        edge_length_abs=edge_length,
        epsilon=epsilon,
        simplify=False,  # the surface is decimated already
        stop_energy=STOP_ENERGY,
        num_opt_iter=MOST_PASSES,
        num_threads=1,
        quiet=True,
    )


def united(vertices: np.ndarray, triangles: np.ndarray) -> Mesh:
    """Points (n, 3) [m] and triangles (m, 3) around all that closed shells enclose, by libigl's exact mesh booleans
    (Zhou et al. 2016). What does not cross keeps its vertices and triangles.

    Shells of vertices (k, 3) [m] and triangles (t, 3) face outward, and inward around cavities.
    """
    from igl.copyleft import cgal  # under the GPL, as Gmsh is

    return cgal.mesh_boolean(vertices, triangles.astype(np.int64), type_str="union")[:2]


def gmsh_triangles(points: np.ndarray, starts: np.ndarray, parents: np.ndarray, edge_length: float) -> Mesh:
    """Points (n, 2) [m] and Delaunay-frontal triangles (m, 3) of Gmsh with an edge length [m], the given boundary
    segments kept.

    All loops (k, 2) [m] stand one after the other, from `starts` (l + 1,) on; `parents` (l,) are -1 for an outer loop,
    else the outer loop that a hole belongs to.
    """
    import gmsh

    _start_gmsh(edge_length)
    geo = gmsh.model.geo
    tags = [geo.addPoint(x, y, 0.0, edge_length) for x, y in points]
    curves = []
    for begin, end in zip(starts[:-1], starts[1:], strict=True):
        loop = tags[begin:end]
        lines = [geo.addLine(a, b) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)]
        for line in lines:
            geo.mesh.setTransfiniteCurve(line, 2)  # the outline is already sampled: two points, one segment
        curves.append(geo.addCurveLoop(lines))
    for outer in np.flatnonzero(parents < 0):
        geo.addPlaneSurface([curves[outer], *(curves[hole] for hole in np.flatnonzero(parents == outer))])
    geo.synchronize()
    coordinates, triangles = _generated(2)
    return coordinates[:, :2], triangles


def gmsh_tetrahedra(
    vertices: np.ndarray, triangles: np.ndarray, patches: np.ndarray, edge_length: float, sharp_angle: float
) -> Mesh:
    """Points (n, 3) [m] and tetrahedra (m, 4), of either orientation, inside a closed surface that Gmsh has meshed anew
    with triangles of one edge length [m]. It raises where a part cannot be parametrised, or the new one crosses itself.

    New vertices lie on the triangles (t, 3) of vertices (k, 3) [m]. Edges stay between the `patches` (t,) that
    triangles belong to, and where the normals of two triangles make more than `sharp_angle` [rad].
    """
    import gmsh

    _start_gmsh(edge_length)
    surfaces = [gmsh.model.addDiscreteEntity(2) for _ in range(patches.max() + 1)]
    gmsh.model.mesh.addNodes(2, surfaces[0], np.arange(1, len(vertices) + 1), vertices.ravel())
    for patch, surface in enumerate(surfaces):
        gmsh.model.mesh.addElementsByType(surface, _TRIANGLE, [], triangles[patches == patch].ravel() + 1)
    # `classifySurfaces` keeps the lines of curves, and cuts what cannot be parametrised within each surface.
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    order = np.lexsort(sides.T)
    first, second = order[::2], order[1::2]  # closed: each edge has two triangles
    borders = sides[first[patches[first // 3] != patches[second // 3]]]
    curve = gmsh.model.addDiscreteEntity(1)
    gmsh.model.mesh.addElementsByType(curve, _LINE, [], borders.ravel() + 1)
    gmsh.model.mesh.classifySurfaces(sharp_angle, True, True, np.pi)
    gmsh.model.mesh.createGeometry()
    geo = gmsh.model.geo
    geo.addVolume([geo.addSurfaceLoop([tag for _, tag in gmsh.model.getEntities(2)])])
    geo.synchronize()
    return _generated(3)


def _start_gmsh(edge_length: float) -> None:
    """An empty model in this process, with one edge length [m] everywhere."""
    import gmsh

    gmsh.initialize(interruptible=False)
    sizes = {f"MeshSize{name}": edge_length for name in ("Min", "Max")}
    unused = {f"MeshSize{name}": 0 for name in ("ExtendFromBoundary", "FromPoints", "FromCurvature")}
    frontal_delaunay, parallel_delaunay = 6, 10
    for option, value in ({"Algorithm": frontal_delaunay, "Algorithm3D": parallel_delaunay} | sizes | unused).items():
        gmsh.option.setNumber(f"Mesh.{option}", value)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)


def _generated(dim: int) -> Mesh:
    """Points (n, 3) and simplices (m, dim + 1) of the model's mesh."""
    import gmsh

    gmsh.model.mesh.generate(dim)
    if dim == 3:
        # It moves and adds vertices inside: a bar of 300 sags by 17 % too little with linear cells, by 21 % without.
        gmsh.model.mesh.optimize("Netgen")
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType({2: _TRIANGLE, 3: _TETRAHEDRON}[dim])
    gmsh.finalize()
    index = np.full(int(tags.max()) + 1, -1, dtype=np.int64)
    index[tags] = np.arange(len(tags))
    return coordinates.reshape(-1, 3), index[nodes.reshape(-1, dim + 1)]


def _seeded_random_device(built: Path) -> None:
    """Compile `_SEEDED_RANDOM_DEVICE` into a shared library."""
    from pdvol.compiled import build  # the processes that import this module need none

    source = built.with_suffix(".c")
    source.write_text(_SEEDED_RANDOM_DEVICE)
    build([source], built)
