"""A mesh file mended into another one."""

from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.meshes import Solid, Surface
from pdvol.meshing.cpu_budget import cpu_budget
from pdvol.meshing.readers import read_with_notes
from pdvol.meshing.repair import repair
from pdvol.runs.shape_check import check_meshes
from pdvol.stages import stage
from pdvol.store.files import require_place

SURFACE_FILES = (".obj", ".off", ".ply")
VOLUME_FILES = (".vtu", ".vtk", ".mesh", ".msh")
"""What keeps all digits of coordinates; STL does not."""


@cpu_budget()
def mend_file(file: Path, out: Path, weld: float, hole: float, envelope: float) -> tuple[list[str], bool]:
    """Write the mended mesh, and judge it as `pdvol check` does.

    Parameters
    ----------
    file, out : of a surface or a volume mesh; `out` of the same sort
    weld, hole, envelope : as for `repair`

    Returns
    -------
    A line for each thing that was done, the last one the verdict; and whether the result is sound.

    Raises
    ------
    InputError
        The file cannot be read or is beyond repair, or `out` cannot be written.
    """
    require_place(out.parent)
    with stage(f"reading {file}"):
        shape, lines = read_with_notes(file)
    kinds = VOLUME_FILES if isinstance(shape, Solid) else SURFACE_FILES
    if out.suffix.lower() not in kinds:
        raise InputError(f"{out}: {file.name} can be written as {', '.join(kinds)}")
    with stage(f"mending {file}"):
        mended, done = repair(shape, weld, hole, envelope, str(file))
    out.parent.mkdir(parents=True, exist_ok=True)
    _write(mended, out)
    verdict = check_meshes([out])
    (entry,) = verdict["files"]
    return [*lines, *(done or ["nothing to mend"]), entry["message"], *entry["notes"]], verdict["sound"]


def _write(shape: Surface | Solid, out: Path) -> None:
    import meshio

    suffix = out.suffix.lower()
    if isinstance(shape, Surface):
        meshio.Mesh(shape.vertices, [("triangle", shape.triangles)]).write(out)
        return
    kind = "tetra" if shape.vertices.shape[1] == 3 else "triangle"
    points = np.column_stack([shape.vertices, np.zeros((len(shape.vertices), 3 - shape.vertices.shape[1]))])
    label = {".msh": "gmsh:physical", ".mesh": "medit:ref"}.get(suffix, "region")
    data = {label: [shape.regions]}
    if suffix == ".msh":
        data["gmsh:geometrical"] = [shape.regions]
    more = {"file_format": "gmsh22"} if suffix == ".msh" else {}
    meshio.Mesh(points, [(kind, shape.cells)], cell_data=data).write(out, **more)
