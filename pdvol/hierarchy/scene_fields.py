"""What a scene says about space, evaluated on its shapes and meshes: its size, and its velocities at t = 0."""

import numpy as np

from pdvol.errors import InputError
from pdvol.hierarchy.cell_materials import cell_materials, check_laws
from pdvol.hierarchy.level_mesh import LevelMesh
from pdvol.hierarchy.readers import read_shape
from pdvol.meshes import Outline
from pdvol.scene import Scene, Support
from pdvol.scene.checks import called


def scene_diagonal(scene: Scene) -> float:
    """Diagonal [m] of the box round all bodies as placed: of their input shapes, so that it is the same on every level."""
    corners = []
    for body in scene.bodies:
        shape = read_shape(body.shape[-1] if isinstance(body.shape, (tuple, list)) else body.shape)
        points = body.placement(shape.points if isinstance(shape, Outline) else shape.vertices)
        corners += [points.min(axis=0), points.max(axis=0)]
    return float(np.linalg.norm(np.max(corners, axis=0) - np.min(corners, axis=0)))


def initial_velocity(scene: Scene, mesh: LevelMesh) -> np.ndarray:
    """(n, d) the scene's velocity field [m/s] at a level's points; spins turn about each body's centre of volume."""
    velocity = np.zeros_like(mesh.points)
    for i, body in enumerate(scene.bodies):
        cells, volumes = mesh.cells[mesh.bodies == i], mesh.volumes[mesh.bodies == i]
        centre = volumes @ mesh.points[cells].mean(axis=1) / volumes.sum()
        mine = mesh.point_bodies == i
        velocity[mine] = body.initial_velocity(mesh.points[mine], centre)
    return velocity


def supported_points(scene: Scene, support: Support, mesh: LevelMesh, level: int) -> np.ndarray:
    """(n,) bool: the level's points that a support holds.

    Raises
    ------
    InputError
        Its functions fail or give arrays of the wrong shape, or it holds nothing.
    """
    points, end = mesh.points, scene.dt * scene.steps
    held = called("a support's `where`", support.where, (points,), (len(points),)).astype(bool)
    if support.body:
        held = held & (mesh.point_bodies == [b.name for b in scene.bodies].index(support.body))
    if not held.any():
        raise InputError(f"a support holds no vertex of level {level}; widen its `where` so that the coarsest level has some")
    for time in (0.0, scene.dt, end):
        moved = called("a support's `motion`", support.motion, (points[held], time), points[held].shape)
        if not np.isfinite(moved).all():
            raise InputError(f"a support's `motion` gives NaN or infinity at t = {time:g} s")
    return held


def check_fields(scene: Scene, mesh: LevelMesh, level: int) -> None:
    """Raise InputError unless loads, velocities, materials and supports fit a level's dimension and points."""
    for load in scene.loads:
        if len(load.acceleration) != mesh.dim:
            raise InputError(f"gravity {tuple(load.acceleration)} has {len(load.acceleration)} components in a {mesh.dim}D scene")
    initial_velocity(scene, mesh)
    if level == 0:
        check_laws(scene, mesh.dim)
        cell_materials(scene, mesh)
    for support in scene.supports:
        supported_points(scene, support, mesh, level)
