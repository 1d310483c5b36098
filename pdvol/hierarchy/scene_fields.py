"""What a scene says about space, evaluated on its shapes and meshes: its size, and its velocities at t = 0."""

import numpy as np

from pdvol.hierarchy.level_mesh import LevelMesh
from pdvol.hierarchy.readers import read_shape
from pdvol.meshes import Outline
from pdvol.scene import Scene


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
