"""Child process: triangulates the inside of closed loops. `python gmsh_worker.py IN.npz OUT.npz`; knows no pdvol, MPI
or PETSc.
"""

import sys

import gmsh
import numpy as np


def triangulate(
    points: np.ndarray, starts: np.ndarray, parents: np.ndarray, edge_length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Delaunay-frontal triangles of edge length `edge_length` [m], the given boundary segments kept.

    points (n, 2): all loops one after the other; starts (k + 1,): where each begins; parents (k,): -1 for an outer
    loop, else the outer loop that a hole belongs to.
    """
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("General.NumThreads", 1)
    gmsh.option.setNumber("Mesh.Algorithm", 6)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMin", edge_length)
    gmsh.option.setNumber("Mesh.MeshSizeMax", edge_length)
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
    gmsh.model.mesh.generate(2)
    node_tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(2)
    gmsh.finalize()
    index = np.full(int(node_tags.max()) + 1, -1, dtype=np.int64)
    index[node_tags] = np.arange(len(node_tags))
    return coordinates.reshape(-1, 3)[:, :2], index[nodes.reshape(-1, 3)]


def main() -> None:
    with np.load(sys.argv[1]) as data:
        points, cells = triangulate(data["points"], data["starts"], data["parents"], float(data["edge_length"]))
    np.savez(sys.argv[2], points=points, cells=cells)


if __name__ == "__main__":
    main()
