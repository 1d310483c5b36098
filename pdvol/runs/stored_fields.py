"""Contact forces and stresses of stored states, for exports, which import no solver themselves."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
from mpi4py import MPI

from pdvol.errors import InputError, PdvolError
from pdvol.integrate.integrator import Integrator, Past, past_of
from pdvol.integrate.replay import Replay
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import level_materials
from pdvol.levels.model import LevelModel, level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.script import Obstacle
from pdvol.parallel import on_root
from pdvol.potentials.elasticity import CauchyStress, Elastic, von_mises
from pdvol.registry import FORMATS
from pdvol.runs.fingerprint import differences
from pdvol.runs.scene_file import both_described, stored_shot
from pdvol.scene import Scene
from pdvol.stages import stage
from pdvol.store.folder import require_scene
from pdvol.store.reader import Run, RunLevel, open_run
from pdvol.store.series import Fields, StepFields, described_densities, nothing_more


class SceneFields:
    """`contact_force` (n, d) [N] and `von_mises` (m,) [Pa] of any step of a level, computed by this rank alone.

    The force is that of barrier and friction on each vertex. Friction is lagged at the step's start, as in its first
    iteration.
    """

    def __init__(self, scene: Scene, run: Run, level: int, obstacles: Sequence[Obstacle]):
        self.level, self._run, diagonal = run.levels[level], run, run.info["diagonal"]
        hierarchy = Hierarchy([stored.mesh for stored in run.levels[: level + 1]], MPI.COMM_SELF)
        self._model = level_model(scene, hierarchy, level, diagonal, obstacles)
        self._replay = Replay(self._model, hierarchy[level])
        self._elastic = [term for term in self._replay.terms if type(term) is Elastic]
        self._stresses = [CauchyStress(term) for term in self._elastic]

    def contact_force(self, step: int) -> np.ndarray:
        """(n, d) [N] at the end of a step; at the start, step 0, nothing slides."""
        past = stored_past(self._run, self._replay.integrator, max(step - 1, 0), self._model)
        x = self._replay.put(step, past, self.level.positions(step), late=self.level.lateness)
        return self._replay.space.to_input(self._replay.force(x, self._replay.contacts))

    def von_mises(self, step: int) -> np.ndarray:
        """(m,) [Pa], of the elastic Cauchy stress."""
        stresses, positions = np.zeros((len(self.level.cells), 3, 3)), self.level.positions(step)
        for term, stress in zip(self._elastic, self._stresses, strict=True):
            term.set_time(step * self._replay.dt)
            stress.add_to(stresses, positions)
        return von_mises(stresses)

    def __call__(self, step: int) -> StepFields:
        with np.errstate(all="ignore"):  # states that no barrier has kept apart have no finite force
            return StepFields(
                points={"contact_force": self.contact_force(step)} if self._replay.contacts else {},
                cells={"von_mises": self.von_mises(step)},
            )


@contextmanager
def exported(
    comm: MPI.Comm, path: Path, scene: Scene, obstacles: Sequence[Obstacle], first: Callable[[], object]
) -> Iterator[None]:
    """Runs a simulation, calls `first` on rank 0 where it could go on, and writes level_N.xdmf of what it has stored,
    also where it could not. Collective.
    """

    def export() -> None:
        def fields(level: int) -> Fields:
            try:
                return SceneFields(scene, run, level, obstacles)
            except (ValueError, RuntimeError):  # a user's law may fail here alone
                return nothing_more

        run = open_run(path)
        FORMATS["xdmf"](run, [level.index for level in run.levels if level.steps], path, fields)

    try:
        yield
        on_root(comm, first)
    except PdvolError:
        with suppress(PdvolError):  # there may be no run, or the disk may be full; the first error is the one to report
            on_root(comm, export)
        raise
    with stage("exporting xdmf"):
        on_root(comm, export)


def stored_past(run: Run, integrator: Integrator, step: int, model: LevelModel) -> Past:
    """The past at the end of a stored step of the model's level, as long as that step's successor used it."""
    level, method = run.levels[model.level], run.info.get("method", "")
    past = _past(level, integrator, step, model)
    if len(past) == 1 or method != "progressive" or level.index == 0:
        return past  # at step 0, the level below may have stored nothing yet
    return past[: len(stored_lead(run, integrator, step, model))]


def stored_lead(run: Run, integrator: Integrator, step: int, model: LevelModel) -> Past:
    """The past by which the level below led the model's level after a stored step."""
    return _past(run.levels[model.level - 1], integrator, step, model)


def _past(level: RunLevel, integrator: Integrator, step: int, model: LevelModel) -> Past:
    """The past of a level at the end of a stored step."""
    return past_of(integrator, level.positions, level.velocities(0), step, model.dt, level.record, model.begins_anew)


def stored_scene(run: Run) -> tuple[Scene, tuple[Obstacle, ...]]:
    """The scene of a stored run, and its obstacles.

    Raises
    ------
    InputError
        Its file is missing, has changed or was never run here; the message names what has changed.
    """
    info = run.info
    require_scene(run.path, info)
    shot = stored_shot(info)
    changed = differences(*both_described(info, shot))
    if changed:
        raise InputError(f"its scene file has changed ({changed[0]})")
    return shot.scene, placed_obstacles(shot.scene.obstacles)


def stored_hierarchy(run: Run) -> Hierarchy:
    """The levels of a stored run with its own bindings, on this rank alone."""
    return Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF, run.info.get("prolongation", "barycentric"))


def stored_densities(run: Run) -> list[np.ndarray]:
    """(m,) [kg/m^d] of each level's cells: of the run's scene, or of its description where that cannot be loaded."""
    try:
        scene = stored_scene(run)[0]
    except InputError:
        scene = None
    return level_densities(run, scene, [])


def level_densities(run: Run, scene: Scene | None, notes: list[str]) -> list[np.ndarray]:
    """(m,) [kg/m^d] of each level's cells: of the scene, or of the run's description of its bodies where there is none.
    Notes name what that leaves out.
    """
    if scene is not None and not all(body.uniform for body in scene.bodies):
        hierarchy = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF)
        return [level_materials(scene, hierarchy, level).density for level in range(len(run.levels))]
    densities, note = described_densities(run)
    notes += [note] if note else []
    return densities
