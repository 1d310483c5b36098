"""Contact forces and stresses of stored states, for exports: `record` writes what it is given here, and knows no
solver.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pdvol.errors import InputError
from pdvol.export.series import StepFields
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import level_materials
from pdvol.levels.space import LevelSpace
from pdvol.meshing.build import read_obstacle
from pdvol.potentials.build import build_terms
from pdvol.potentials.elasticity import Elastic
from pdvol.potentials.potential import Positions, Potential
from pdvol.potentials.stress import CauchyStress, von_mises
from pdvol.runs.scene_file import load_shot, stored_settings
from pdvol.scene import Rigid, Scene
from pdvol.scene.fingerprint import differences
from pdvol.store.folder import require_scene
from pdvol.store.reader import Run, RunLevel


class SceneFields:
    """`contact_force` (n, d) [N] and `von_mises` (m,) [Pa] of any step of a level, computed by this rank alone.

    The force is what barrier and friction do to each vertex, friction lagged at the step's start as in its first
    iteration.
    """

    def __init__(self, scene: Scene, run: Run, level: int, obstacles):
        self.level, self.dt = run.levels[level], run.dt
        if level == 0 or all(body.uniform for body in scene.bodies):
            self.space, materials = LevelSpace(self.level.mesh, MPI.COMM_SELF), None
        else:
            hierarchy = Hierarchy([stored.mesh for stored in run.levels[: level + 1]], MPI.COMM_SELF)
            self.space, materials = hierarchy[level], level_materials(scene, hierarchy, level)
        terms = build_terms(scene, self.space, run.info["diagonal"], obstacles, materials=materials).potentials
        self._contact, self._kappas = (
            [term for term in terms if term.name in ("barrier", "friction")],
            stored_stiffness(self.level),
        )
        self._stresses = [CauchyStress(term) for term in terms if isinstance(term, Elastic)]

    def contact_force(self, step: int) -> np.ndarray:
        """(n, d) [N] at the end of a step; at the start, step 0, nothing slides."""
        start, end = (
            Positions(self.space, self.space.from_input(self.level.positions(n))) for n in (max(step - 1, 0), step)
        )
        begin = max(step - 1, 0) * self.dt - self.level.behind(max(step - 1, 0))
        stiffen(self._contact, self._kappas.get(max(step, 1)))
        for term in self._contact:
            term.begin_step(start, begin, begin + self.dt)
        for term in self._contact:
            term.place(step * self.dt - self.level.behind(step))
        force = -sum((term.gradient(end) for term in self._contact), start=np.zeros_like(end.owned))
        return self.space.to_input(force)

    def von_mises(self, step: int) -> np.ndarray:
        """(m,) [Pa], of the elastic Cauchy stress."""
        stresses, positions = np.zeros((len(self.level.cells), 3, 3)), self.level.positions(step)
        for stress in self._stresses:
            stress.add_to(stresses, positions)
        return von_mises(stresses)

    def __call__(self, step: int) -> StepFields:
        with np.errstate(all="ignore"):  # states that no barrier has kept apart have no finite force
            return StepFields(
                points={"contact_force": self.contact_force(step)} if self._contact else {},
                cells={"von_mises": self.von_mises(step)},
            )


def stored_stiffness(level: RunLevel) -> dict[int, float]:
    """The barrier's stiffness in each step, as logged: some of its laws choose it step by step, from what is not
    stored.
    """
    return {record["step"]: record["kappa"] for record in level.log if record.get("kappa")}


def stiffen(terms: Sequence[Potential], kappa: float | None) -> None:
    """Gives the barriers among the terms a logged stiffness, if there is one."""
    for term in terms:
        if term.name == "barrier" and kappa is not None:
            term.kappa = kappa


def stored_scene(run: Run) -> tuple[Scene, list]:
    """The scene of a stored run, and its rigid obstacles' geometry.

    Raises
    ------
    InputError
        Its file is gone or has changed; one line says what.
    """
    info = run.info
    require_scene(run.path, info)
    if not Path(info.get("scene_file", "")).is_file():
        raise InputError(f"its scene file {info.get('scene_file', '')} is gone")
    shot = load_shot(info["scene_file"], stored_settings(info["parameters"]), info["steps"])
    changed = differences(info["description"], shot.description())
    if changed:
        raise InputError(f"its scene file has changed ({changed[0]})")
    return shot.scene, [read_obstacle(o) for o in shot.scene.obstacles if isinstance(o, Rigid)]
