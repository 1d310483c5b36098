"""A scene on one level: all that the scene describes, evaluated on the level's mesh, in SI units.

What the scene lacks is an empty tuple here. Terms, time stepping, measures and exports take a `LevelModel`; only the
code that builds levels uses the `Scene` itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pdvol.geometry.level_mesh import LevelMesh
from pdvol.levels.attachments import BoundSprings, Pulls, bound_springs
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.materials import CellMaterials, CellMuscle, level_materials, level_muscles
from pdvol.levels.obstacles import ground_of
from pdvol.levels.scene_fields import chosen_points, initial_velocity, supported_points
from pdvol.levels.script import ON_TIME, HeldPoints, Obstacle
from pdvol.levels.start import start_positions
from pdvol.scene import Barrier, Friction, Gravity, Impulse, Load, Penalty, Scene, Solver, metres


@dataclass(frozen=True, eq=False)
class PlacedLoad:
    """A load and the vertices (n,) bool that it acts on."""

    load: Load
    mask: np.ndarray


@dataclass(frozen=True, eq=False, repr=False)
class LevelModel:
    """A scene on one level.

    Attributes
    ----------
    level : its number, 0 the coarsest
    mesh : LevelMesh
    start : (n, d) [m]
        Where its points are at t = 0.
    bodies : their names
    materials : CellMaterials
    velocity : (n, d) [m/s]
        At t = 0.
    loads : tuple of PlacedLoad
    supports : tuple of HeldPoints
    obstacles : tuple of Obstacle
    ground : none or one of the obstacles (`obstacles.ground_of`)
    contact : the scene's
    diagonal : of the smallest free body [m], of which relative lengths and speeds of `contact` are fractions
    springs : none or one BoundSprings, of all attachments
    pulls : none or one Pulls, of the scene and its hand
    muscles : tuple of CellMuscle
    penalty : weights that hold levels together
    feedback : of the drift from the level below, as `Scene` has it
    integrator : its name in the registry
    solver : settings; its tolerance is in m/s
    dt, steps : time step [s], number of steps
    """

    level: int
    mesh: LevelMesh
    start: np.ndarray
    bodies: tuple[str, ...]
    materials: CellMaterials
    velocity: np.ndarray
    loads: tuple[PlacedLoad, ...]
    supports: tuple[HeldPoints, ...]
    obstacles: tuple[Obstacle, ...]
    ground: tuple[Obstacle, ...]
    contact: tuple[Barrier | Friction, ...]
    diagonal: float
    springs: tuple[BoundSprings, ...]
    pulls: tuple[Pulls, ...]
    muscles: tuple[CellMuscle, ...]
    penalty: Penalty
    feedback: float
    integrator: str
    solver: Solver
    dt: float
    steps: int

    @property
    def free(self) -> np.ndarray:
        """(n,) bool: vertices that no support ever holds."""
        free = np.ones(len(self.mesh.points), dtype=bool)
        for support in self.supports:
            free &= ~support.mask
        return free

    @property
    def friction(self) -> tuple[Friction, ...]:
        """None or one."""
        return tuple(each for each in self.contact if isinstance(each, Friction))

    def begins_anew(self, step: int) -> bool:
        """Whether velocities or forces jump where a step ends: a support lets go there, pulls begin or end, or an
        impulse acts in that step or the next one. The same on every level.
        """
        start, end, after = ((step + k) * self.dt for k in (-1, 0, 1))
        impulses = (placed.load.time * (1.0 + ON_TIME) for placed in self.loads if isinstance(placed.load, Impulse))
        released = (support.holds(start, self.dt) and not support.holds(end, self.dt) for support in self.supports)
        jumps = any(released) or any(start <= time < after for time in impulses)
        return jumps or any(pulls.change(step) for pulls in self.pulls)

    def __repr__(self) -> str:
        return f"LevelModel(level {self.level}, {len(self.mesh.points)} vertices, {len(self.bodies)} bodies)"


def level_model(
    scene: Scene, hierarchy: Hierarchy, level: int, diagonal: float, obstacles: Sequence[Obstacle] = ()
) -> LevelModel:
    """A scene on a level of a hierarchy; materials, muscles and attachments are chosen on the coarsest level.
    Collective.

    Parameters
    ----------
    diagonal : of the smallest free body [m] (`scene_diagonal`), for relative lengths
    obstacles : of the scene (`placed_obstacles`)

    Raises
    ------
    InputError
        A function of the scene fails, or a support or a load holds no vertex.
    """
    mesh, coarsest = hierarchy.meshes[level], hierarchy.meshes[0]
    materials = level_materials(scene, hierarchy, level)
    start = start_positions(scene, mesh, level)
    supports = tuple(supported_points(scene, support, mesh, level, start) for support in scene.supports)
    everywhere = np.ones(len(mesh.points), dtype=bool)
    mask = lambda load: everywhere if isinstance(load, Gravity) else chosen_points(scene, load, mesh)
    return LevelModel(
        level=level,
        mesh=mesh,
        start=start,
        bodies=tuple(body.name for body in scene.bodies),
        materials=materials,
        velocity=initial_velocity(scene, mesh, start),
        loads=tuple(PlacedLoad(load, mask(load)) for load in scene.loads),
        supports=supports,
        obstacles=tuple(obstacles),
        ground=ground_of((*supports, *obstacles), scene.dt * scene.steps),
        contact=tuple(scene.contact),
        diagonal=diagonal,
        springs=bound_springs(scene, coarsest, start_positions(scene, coarsest, 0), mesh, start),
        pulls=(Pulls(scene, coarsest, mesh),) if scene.pulls or scene.hand else (),
        muscles=level_muscles(scene, hierarchy, level),
        penalty=scene.penalty,
        feedback=scene.feedback,
        integrator=scene.integrator,
        solver=replace(scene.solver, tolerance=metres(scene.solver.tolerance, diagonal)),
        dt=scene.dt,
        steps=scene.steps,
    )
