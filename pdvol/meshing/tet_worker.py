"""Child process: tetrahedralises a surface. `python tet_worker.py IN.npz OUT.npz`; imports nothing of pdvol, MPI or
PETSc.
"""

import os
import sys
from collections.abc import Callable

import numpy as np


def ftetwild(
    vertices: np.ndarray, triangles: np.ndarray, edge_length: np.ndarray, epsilon: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    import pytetwild

    # One processor: fTetWild's parallel passes depend on who comes first.
    cpus = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cpus[os.getpid() % len(cpus)]})
    return pytetwild.tetrahedralize(
        vertices,
        triangles.astype(np.int32),
        edge_length_abs=float(edge_length),
        epsilon=float(epsilon),
        num_threads=1,
        quiet=True,
    )


def tetgen(vertices: np.ndarray, triangles: np.ndarray, max_volume: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    import tetgen as library

    mesher = library.TetGen(vertices, triangles.astype(np.int32))
    points, cells = mesher.tetrahedralize(
        order=1, nobisect=True, quality=True, minratio=1.5, fixedvolume=True, maxvolume=float(max_volume)
    )[:2]
    return points, cells


MESHERS: dict[str, Callable[..., tuple[np.ndarray, np.ndarray]]] = {"ftetwild": ftetwild, "tetgen": tetgen}


def main() -> None:
    with np.load(sys.argv[1]) as data:
        given = dict(data)
    points, cells = MESHERS[str(given.pop("mesher"))](**given)
    np.savez(sys.argv[2], points=points, cells=cells)


if __name__ == "__main__":
    main()
