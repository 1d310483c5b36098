"""The levels of a scene before they are marched: built, set apart from each other and checked at t = 0."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pdvol.errors import LevelError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.function_check import call_functions
from pdvol.levels.level_check import level_defects, weight_notes
from pdvol.levels.obstacles import Geometry, placed_obstacles, read_geometry
from pdvol.levels.scene_fields import scene_diagonal
from pdvol.runs.separation import build_apart
from pdvol.scene import Scene
from pdvol.stages import stage


@dataclass(frozen=True, eq=False)
class Prepared:
    """A scene's levels, checked at t = 0.

    Attributes
    ----------
    meshes : coarsest first
    kept : how many of them are those of a stored run
    geometry : of the scene's obstacles
    diagonal : what relative lengths are fractions of [m]
    mended : a line for each body that was set apart from others, or that cannot carry its weight
    refused : of the coarsest level without a mesh, if there is one; it and finer ones are left out
    """

    meshes: Sequence[LevelMesh]
    kept: int
    geometry: list[Geometry]
    diagonal: float
    mended: list[str]
    refused: LevelError | None = None


def prepared_levels(
    scene: Scene, last: int, stored: Sequence[LevelMesh] = (), diagonal: float | None = None
) -> Prepared:
    """Levels 0 to `last` of a scene. Serial.

    Parameters
    ----------
    stored : meshes of the coarsest levels in a run of the scene
    diagonal : what relative lengths are fractions of [m]; that of the scene when None

    Raises
    ------
    InputError
        Something in the scene or its meshes is unfit.
    LevelError
        No mesh came out for level 0.
    """
    geometry = read_geometry(scene.obstacles)
    obstacles = placed_obstacles(scene.obstacles, geometry)
    meshes = stored
    mended: list[str] = []
    if len(stored) <= last:
        call_functions(scene, obstacles)
        try:
            built, mended = build_apart(scene, last + 1, obstacles)
        except LevelError as error:
            if error.level == 0:
                raise
            return replace(prepared_levels(scene, error.level - 1, stored, diagonal), refused=error)
        meshes = [*stored, *built[len(stored) :]]
    diagonal = scene_diagonal(scene) if diagonal is None else diagonal
    for level in range(len(meshes)):
        with stage(f"checking level {level}"):
            for defect in level_defects(scene, meshes, level, obstacles, diagonal):
                raise defect.error
    mended += weight_notes(scene, meshes[0]) if len(stored) <= last else ()
    return Prepared(meshes, len(stored), geometry, diagonal, mended)
