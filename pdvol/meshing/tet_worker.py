"""Child process: tetrahedralises a surface. `python tet_worker.py IN.npz OUT.npz`; imports nothing of pdvol, MPI or
PETSc.
"""

import ctypes
import os
import sys
from types import ModuleType

import numpy as np

STOP_ENERGY = 20.0
"""AMIPS energy of the worst cell at which fTetWild stops: 3 divided by the mean ratio, so 0.15. Its default of 10 takes
up to four times as long and adds vertices at sharp edges.
"""
MOST_PASSES = 3
"""Passes over the mesh after which it stops, too. Later ones improve few cells, and each goes over the whole box around
the shape, with up to ten times as many vertices as inside.
"""


def ftetwild(
    vertices: np.ndarray, triangles: np.ndarray, edge_length: np.ndarray, epsilon: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    # pytetwild adds itself to pyvista where that can be extended. Importing pyvista takes longer than a coarse mesh.
    sys.modules.setdefault("pyvista", ModuleType("pyvista"))
    import pytetwild

    # One processor, since the order of fTetWild's threads changes the mesh. The present one: two meshers then use two.
    os.sched_setaffinity(0, {ctypes.CDLL(None).sched_getcpu()})
    return pytetwild.tetrahedralize(
        vertices,
        triangles.astype(np.int32),
        edge_length_abs=float(edge_length),
        epsilon=float(epsilon),
        simplify=False,  # the surface is decimated already
        stop_energy=STOP_ENERGY,
        num_opt_iter=MOST_PASSES,
        num_threads=1,
        quiet=True,
    )


def main() -> None:
    with np.load(sys.argv[1]) as data:
        given = dict(data)
    points, cells = ftetwild(**given)
    np.savez(sys.argv[2], points=points, cells=cells)


if __name__ == "__main__":
    main()
