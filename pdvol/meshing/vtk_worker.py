"""Child process: reads a .vtk or .vtu file. `python vtk_worker.py IN.npz OUT.npz`; imports nothing of pdvol, MPI or
PETSc.
"""

import sys
from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkCommonDataModel import vtkGenericCell


def other_solids(kinds: np.ndarray) -> list[int]:
    """Those of VTK's cell types that fill space and are no tetrahedra."""
    cell, found = vtkGenericCell(), []
    for kind in np.unique(kinds):
        cell.SetCellType(int(kind))
        if cell.GetCellDimension() == 3 and kind not in (pyvista.CellType.TETRA, pyvista.CellType.QUADRATIC_TETRA):
            found.append(int(kind))
    return found


def main() -> None:
    with np.load(sys.argv[1]) as data:
        grid = pyvista.read(str(data["path"])).cast_to_unstructured_grid()
    found: dict[str, Any] = {"points": np.asarray(grid.points)}
    rows = []
    for name, kind, nodes in (
        ("tetra", pyvista.CellType.TETRA, 4),
        ("tetra10", pyvista.CellType.QUADRATIC_TETRA, 10),
        ("triangle", pyvista.CellType.TRIANGLE, 3),
    ):
        none = np.empty((0, nodes), dtype=np.int64)
        found[name] = np.asarray(dict(grid.cells_dict).get(np.uint8(kind), none))
        rows.append(np.flatnonzero(grid.celltypes == int(kind)))
    found["others"] = np.int64(sum(np.count_nonzero(grid.celltypes == kind) for kind in other_solids(grid.celltypes)))
    order = np.concatenate(rows)
    for name in grid.cell_data:
        found[f"label {name}"] = np.asarray(grid.cell_data[name])[order]
    np.savez(sys.argv[2], **found)


if __name__ == "__main__":
    main()
