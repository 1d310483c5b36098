"""A scene's functions of space, evaluated on its shapes and meshes: size, velocities at t = 0, chosen points."""

from collections.abc import Callable

import numpy as np

from pdvol.errors import InputError
from pdvol.geometry.closed_surfaces import gyration_diagonal
from pdvol.geometry.level_mesh import LevelMesh, boundary_facets, simplex_centres
from pdvol.levels.materials import cell_materials, cell_muscles, check_laws
from pdvol.levels.obstacles import motion_of
from pdvol.levels.script import HeldPoints
from pdvol.levels.start import start_positions
from pdvol.meshes import Outline, Solid, Surface
from pdvol.meshing.readers import read_shape
from pdvol.scene import (
    Flow,
    Force,
    Gravity,
    Impulse,
    Keyed,
    Load,
    PointCache,
    PointForce,
    Pressure,
    Scene,
    Support,
    TakeOver,
    at_time,
    moved,
)
from pdvol.scene.checks import chosen, near

Chooser = Support | Force | PointForce | Impulse | Flow | Pressure
"""What acts on chosen points."""
MOTION_SAMPLES = 50  # times of a scene at which its motions are evaluated before a run, to find those that fail


def scene_diagonal(scene: Scene) -> float:
    """Diagonal [m] of the smallest body that moves freely, as placed, by its input shape (`gyration_diagonal`): it is
    the same on every level, and depends neither on how far apart bodies are nor on how the scene is turned.

    A body that supports hold wholly and for ever does not move freely. Where all are held so, the smallest of them
    counts.
    """
    free: list[float] = []
    held: list[float] = []
    for body in scene.bodies:
        points, facets = _boundary(read_shape(body.shape[-1] if isinstance(body.shape, (tuple, list)) else body.shape))
        points = body.placement(points)
        (held if _held_for_ever(scene, body.name, points) else free).append(gyration_diagonal(points, facets))
    return min(free or held)


def _boundary(shape: Outline | Surface | Solid) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, d) [m] and boundary facets (m, d) of a body's shape."""
    if isinstance(shape, Outline):
        ends = np.arange(len(shape.points))
        return np.asarray(shape.points, dtype=float), np.column_stack([ends, np.roll(ends, -1)])
    return shape.vertices, shape.triangles if isinstance(shape, Surface) else boundary_facets(shape.cells)[0]


def _held_for_ever(scene: Scene, body: str, points: np.ndarray) -> bool:
    """Whether supports that never let go hold all points (n, d) of a body."""
    held = np.zeros(len(points), dtype=bool)
    for support in scene.supports:
        if support.body in ("", body) and np.isinf(support.release):
            held |= _mask(support, support.where, points)
    return bool(held.all())


def way_up(scene: Scene, dim: int) -> list[float] | None:
    """The upward direction of pictures: against the first gravity at the first time that has one; None without one."""
    gravity = next((load.acceleration for load in scene.loads if isinstance(load, Gravity)), dim * (0.0,))
    if isinstance(gravity, Keyed):
        times = [0.0, *gravity.times]
    else:
        times = [step * scene.dt for step in range(scene.steps + 1)] if callable(gravity) else [0.0]
    for time in times:
        pull = at_time("gravity", gravity, time, dim)
        if pull.any():
            return [0.0 - float(a) for a in pull]
    return None


def initial_velocity(scene: Scene, mesh: LevelMesh, start: np.ndarray | None = None) -> np.ndarray:
    """(n, d) the scene's velocity field [m/s] at a level's points, which are at `start` (n, d) [m] at t = 0, or else at
    rest. Spins turn about each body's centre there.
    """
    velocity, start = np.zeros_like(mesh.points), mesh.points if start is None else start
    surface = np.zeros(len(mesh.points), dtype=bool)
    surface[mesh.boundary] = True
    for i, body in enumerate(scene.bodies):
        cells, volumes = mesh.cells[mesh.bodies == i], mesh.volumes[mesh.bodies == i]
        centre = volumes @ simplex_centres(start, cells) / volumes.sum()
        mine = mesh.point_bodies == i
        velocity[mine] = body.initial_velocity(mesh.points[mine], centre, start[mine])
        if isinstance(body.velocity, TakeOver):
            from pdvol.levels.animated import taken_velocity

            velocity[mine] += taken_velocity(
                body.velocity, start[mine], surface[mine], f"body {body.name!r}, which takes over an animation"
            )
    return velocity


def chosen_points(scene: Scene, chooser: Chooser, mesh: LevelMesh) -> np.ndarray:
    """(n,) bool: a level's points that a support or a load chooses by its `body` and, if it has one, its `where`, which
    is given the body's points alone.
    """
    held = np.ones(len(mesh.points), dtype=bool)
    if chooser.body:
        held = mesh.point_bodies == [b.name for b in scene.bodies].index(chooser.body)
    if hasattr(chooser, "where"):
        held[held] = _mask(chooser, chooser.where, mesh.on_the_shape[held])
    return held


def _mask(chooser: Chooser, where: Callable, points: np.ndarray) -> np.ndarray:
    """(n,) bool: the points (n, d) that the `where` of a support or a load chooses."""
    return chosen(f"a {type(chooser).__name__.lower()}'s `where`", where, points)


def supported_points(scene: Scene, support: Support, mesh: LevelMesh, level: int, start: np.ndarray) -> HeldPoints:
    """The level's points that a support holds, which are at `start` (n, d) [m] at t = 0; where a point cache moves
    them, those on the surface.

    Raises
    ------
    InputError
        Its functions fail or give arrays of the wrong shape, it holds nothing, or its point cache is too far away.
    """
    points = mesh.points
    held = chosen_points(scene, support, mesh)
    if isinstance(support.motion, PointCache):
        held &= np.isin(np.arange(len(points)), mesh.boundary)
    if not held.any():
        raise InputError(
            f"a support holds no vertex of level {level}; widen its `where` so that the coarsest level has some"
        )
    motion = motion_of(support.motion, start[held], support_label(support, level))
    for time in motion_times(scene, support):
        moved(motion, start[held], time, "a support")
    return HeldPoints(held, start[held], motion, support.release)


def motion_times(scene: Scene, support: Support | None = None) -> list[float]:
    """Times [s] of a scene at which its motions are tried; of a support's, while it holds."""
    return [
        float(number * scene.dt)
        for number in np.unique(np.linspace(0, scene.steps, MOTION_SAMPLES).astype(int))
        if number == 0 or support is None or support.holds((number - 1) * scene.dt, scene.dt)
    ]


def support_label(support: Support, level: int) -> str:
    """A support's name in messages about what it holds on a level."""
    return f"a support of {f'body {support.body!r}' if support.body else 'all bodies'}, level {level}"


def check_fields(scene: Scene, mesh: LevelMesh, level: int) -> None:
    """Raise InputError unless starts, loads, velocities, materials and supports fit a level's dimension and points."""
    start = start_positions(scene, mesh, level)
    for load in scene.loads:
        _check_load(scene, load, mesh, level)
    initial_velocity(scene, mesh, start)
    if level == 0:
        check_laws(scene, mesh.dim, cell_materials(scene, mesh))
        cell_muscles(scene, mesh)
        if scene.attachments or scene.pulls or scene.hand:
            from pdvol.levels.attachments import Pulls, bound_springs  # it loads search trees and finite elements

            bound_springs(scene, mesh, start, mesh, start)
            Pulls(scene, mesh, mesh).check()
    for support in scene.supports:
        supported_points(scene, support, mesh, level, start)


def check_load_in_time(scene: Scene, load: Load, points: np.ndarray) -> None:
    """Raise InputError unless what a load is in time fits points (n, d) [m], at the start and at the end of a scene."""
    dim = points.shape[1]
    for time in (0.0, scene.dt, scene.dt * scene.steps):
        if isinstance(load, Flow):
            load.at(points, time)
        elif isinstance(load, Pressure):
            load.at(time)
        elif isinstance(load, Gravity):
            at_time("gravity", load.acceleration, time, dim)
        elif isinstance(load, Impulse):
            at_time("Impulse.velocity", load.velocity, time, dim)
        else:  # what has a force: mypy finds a kind without one
            at_time(f"{type(load).__name__}.force", load.force, time, dim)


def _check_load(scene: Scene, load: Load, mesh: LevelMesh, level: int) -> None:
    kind = type(load).__name__
    check_load_in_time(scene, load, mesh.points)
    if isinstance(load, Gravity):
        return
    held = chosen_points(scene, load, mesh)
    if not held.any():
        raise InputError(
            f"a {kind} holds no vertex of level {level}; widen its `where` so that the coarsest level has some"
        )
    if isinstance(load, PointForce):
        at = at_time("PointForce.at", load.at, 0.0, mesh.dim)
        near("PointForce.at", at, mesh.points[held], load.body or "all bodies")
