"""The levels of one mesh, without a simulation."""

from pathlib import Path

import numpy as np
from mpi4py import MPI

from pdvol.geometry.closed_surfaces import enclosed_volume
from pdvol.geometry.distances import hausdorff_distance
from pdvol.geometry.level_mesh import LevelMesh, connected_parts
from pdvol.levels.hierarchy import Hierarchy
from pdvol.meshing.cpu_budget import cpu_budget
from pdvol.meshing.decimate import topology
from pdvol.meshing.readers import read_shape
from pdvol.meshing.tetrahedralise import mean_ratio
from pdvol.meshing.validate import drop_unused
from pdvol.meshing.verdict import boundary_facets_of, judge
from pdvol.meshing.vtu import write_vtu
from pdvol.runs.preflight import level_sizes, sizes_line
from pdvol.runs.preparation import prepared_levels
from pdvol.runs.run_summary import binding_lines
from pdvol.runs.shape_check import shape_notes
from pdvol.scene import Body, NeoHookean, Scene
from pdvol.stages import stage
from pdvol.store.files import make_folder, require_place


def write_hierarchy(
    mesh: Path, targets: tuple[int, ...], out: Path, prolongation: str = "barycentric"
) -> tuple[Hierarchy, list[str]]:
    """Build the levels of a mesh, and write each as VTU into `out`.

    Parameters
    ----------
    mesh : a file of a surface or volume mesh
    targets : wanted vertices, coarsest first
    out : a folder; it is made where there is none
    prolongation : a name in `pdvol.registry.INTERPOLANTS`

    Returns
    -------
    tuple[Hierarchy, list[str]]
        The levels; their sizes and qualities, how far their shapes are from the input's, and their bindings, one line
        each.

    Raises
    ------
    InputError
        The mesh cannot be read or meshed, the prolongation is unknown, or `out` cannot be written.
    """
    require_place(out)
    scene = Scene(bodies=(Body(mesh, NeoHookean(1e5), targets, name=mesh.stem),), dt=0.01, steps=0)
    with cpu_budget(sum(targets)):
        notes = shape_notes(scene)
        levels = prepared_levels(scene, scene.levels - 1)
    if levels.refused is not None:
        raise levels.refused
    make_folder(out)
    hierarchy = Hierarchy(levels.meshes, MPI.COMM_SELF, prolongation)
    points, facets = boundary_facets_of(judge(read_shape(mesh), mesh.stem)[1])
    lines = [f"note: {note}" for note in notes]
    for level, level_mesh in enumerate(levels.meshes):
        homes = {"home_cell": hierarchy.prolongation(level).binding.cells} if level else {}
        write_vtu(out / f"level_{level}.vtu", level_mesh, homes)
        with stage(f"measuring level {level}"):
            quality = mean_ratio(level_mesh.points, level_mesh.cells)
            worst = f"worst mean ratio {quality.min():.2f} (cell {quality.argmin()})"
            kept = _shape_words(level_mesh, points, facets)
            lines.append(f"{sizes_line(level_sizes(level_mesh, level))}, {worst}; {kept}")
    return hierarchy, [*lines, *binding_lines(hierarchy)]


def _shape_words(mesh: LevelMesh, points: np.ndarray, facets: np.ndarray) -> str:
    """What a level keeps of the input's boundary."""
    volume, wanted = float(mesh.volumes.sum()), enclosed_volume(points, facets)
    distance = hausdorff_distance(mesh.points, mesh.boundary, points, facets)
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0)))
    line = (
        f"{distance:.3g} m from the input (Hausdorff, {distance / diagonal:.2%} of its diagonal), volume"
        f" {volume / wanted - 1:+.2g} of the input's, "
    )
    corners, triangles = drop_unused(mesh.points, mesh.boundary)
    if mesh.dim == 2:
        return line + f"{int(connected_parts(triangles, len(corners)).max()) + 1} boundary loops"
    count, euler = topology(triangles, len(corners))
    return line + f"{count} {'shell' if count == 1 else 'shells'}, genus {count - euler // 2}"
