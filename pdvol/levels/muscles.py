"""The cells of a scene's muscles: chosen on the coarsest level, carried to the finer ones by the binding."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.level_mesh import LevelMesh, simplex_centres
from pdvol.scene import Muscle, Scene
from pdvol.scene.checks import chosen

if TYPE_CHECKING:  # it loads the finite elements, which describing a scene does not need
    from pdvol.levels.hierarchy import Hierarchy


@dataclass(frozen=True, eq=False)
class CellMuscle:
    """A muscle on a level.

    Attributes
    ----------
    muscle : Muscle
    cells : (k,) int64, ascending, in the input's order
    places : (k, d) [m]
        Where its functions are evaluated: centres of the coarsest level's cells.
    fibres : (k, d) unit vectors
    """

    muscle: Muscle
    cells: np.ndarray
    places: np.ndarray
    fibres: np.ndarray

    def carried(self, origins: np.ndarray) -> "CellMuscle":
        """The same on a finer level whose cells inherit from these: `origins` (m_fine,)."""
        rows = np.full(int(origins.max(initial=0)) + 1, -1)
        known = self.cells < len(rows)
        rows[self.cells[known]] = np.flatnonzero(known)
        taken = rows[origins]
        cells = np.flatnonzero(taken >= 0)
        return CellMuscle(self.muscle, cells, self.places[taken[cells]], self.fibres[taken[cells]])


def cell_muscles(scene: Scene, mesh: LevelMesh) -> tuple[CellMuscle, ...]:
    """The muscles on a scene's coarsest level.

    Raises
    ------
    InputError
        A muscle holds no cell, or one of its functions fails at the start or at the end of the scene.
    """
    if not scene.muscles:
        return ()
    names, centres = [body.name for body in scene.bodies], simplex_centres(mesh.points, mesh.cells)
    places = simplex_centres(mesh.on_the_shape, mesh.cells)
    found = []
    for muscle in scene.muscles:
        mine = mesh.bodies == names.index(muscle.body)
        mine[mine] = chosen("Muscle.where", muscle.where, places[mine])
        cells = np.flatnonzero(mine)
        if len(cells) == 0:
            raise InputError(
                f"Muscle.where holds no cell of body {muscle.body!r} on the coarsest level; widen it, or give that"
                " level more vertices"
            )
        for time in (0.0, scene.dt, scene.dt * scene.steps):
            muscle.tension(time, centres[cells])
        found.append(CellMuscle(muscle, cells, centres[cells], muscle.fibres(centres[cells])))
    return tuple(found)


def level_muscles(scene: Scene, hierarchy: "Hierarchy", level: int) -> tuple[CellMuscle, ...]:
    """The muscles on any level. Collective where there are some: only then is anything bound."""
    coarsest = cell_muscles(scene, hierarchy.meshes[0])
    if level == 0 or not coarsest:
        return coarsest
    origins = hierarchy.origins(level)
    return tuple(muscle.carried(origins) for muscle in coarsest)
