"""The camera: one for all the moments and levels of a picture, so that they can be compared."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel

VIEW_ANGLE = 24.0  # degrees from the picture's lower to its upper edge: small, so that shapes are hardly distorted
MARGIN = 1.08  # the picture's half height over that of its content
OBSTACLE_MARGIN = 0.3  # share of the bodies' diagonal within which obstacles count: a floor mesh may be far larger


@dataclass(frozen=True, eq=False)
class Camera:
    """Position, direction and field of view.

    Attributes
    ----------
    right, up, towards : (3,) float64
        Unit vectors: the picture's axes, and from the focus to the camera.
    focus : (3,) float64 [m]
        The point in the picture's middle.
    distance : float [m]
        From the focus to the camera; 2D scenes are drawn in parallel projection.
    half_height : float [m]
        Half of the picture's height at the focus.
    size : float [m]
        The diagonal of the content.
    aspect : float
        Width over height.
    """

    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray
    focus: np.ndarray
    distance: float
    half_height: float
    size: float
    aspect: float

    @property
    def position(self) -> np.ndarray:
        """(3,) [m]."""
        return self.focus + self.distance * self.towards

    def set_up(self, camera: Any, parallel: bool) -> None:
        """Give a pyvista camera this position, direction and field of view, in perspective or parallel projection."""
        camera.focal_point, camera.up, camera.position = self.focus, self.up, self.position
        camera.view_angle, camera.parallel_projection = VIEW_ANGLE, parallel
        camera.parallel_scale = self.half_height
        camera.clipping_range = (0.05 * self.distance, self.distance + 20 * self.size)


def in_3d(points: np.ndarray) -> np.ndarray:
    """Points with a zero third coordinate in 2D, shape (n, 3)."""
    return np.pad(np.asarray(points, dtype=float), ((0, 0), (0, 3 - np.shape(points)[1])))


def camera_of_run(
    run: Run, levels: Sequence[RunLevel], steps: Sequence[int], obstacles: Sequence[DrawnObstacle], turn: float = 0.0
) -> Camera:
    """The camera that shows all these levels at all these steps, and the obstacles that are not planes.

    `turn` as for `fitted_camera`.
    """
    content = content_of_run(levels, steps, obstacles)
    return fitted_camera(content, levels[0].rest.shape[1], upward_of_run(run, obstacles), turn)


def content_of_run(levels: Sequence[RunLevel], steps: Sequence[int], obstacles: Sequence[DrawnObstacle]) -> np.ndarray:
    """(n, 3) [m]: points of all bodies on these levels at these steps, and of the obstacles near them."""
    content = [
        in_3d(level.positions(step)[np.unique(level.surface)])
        for level in levels
        for step in steps
        if step < level.steps
    ]
    bodies = np.concatenate(content)
    low, high = bodies.min(axis=0), bodies.max(axis=0)
    margin = OBSTACLE_MARGIN * np.linalg.norm(high - low)
    for obstacle in obstacles:
        if obstacle.kind != "plane":
            vertices = in_3d(np.concatenate([obstacle.vertices(step) for step in steps]))
            content.append(np.clip(vertices, low - margin, high + margin))
    return np.concatenate(content)


def upward_of_run(run: Run, obstacles: Sequence[DrawnObstacle]) -> np.ndarray:
    """(2,) or (3,) up: `run.info["up"]` where the run has it, else the first plane's normal, else z."""
    upward = run.info.get("up") or next((o.plane(0)[1] for o in obstacles if o.kind == "plane"), (0.0, 0.0, 1.0))
    return np.asarray(upward, dtype=float)


def front_of(upward: np.ndarray) -> np.ndarray:
    """(3,) unit vector towards the front of a 3D scene, which is -y where z is up and +z where y is."""
    upward = upward / np.linalg.norm(upward)
    front = np.array([0.0, -1.0, 0.0]) if abs(upward[1]) < 0.7 else np.array([0.0, 0.0, 1.0])
    front -= (front @ upward) * upward
    return front / np.linalg.norm(front)


def fitted_camera(points: np.ndarray, dim: int, upward: np.ndarray, turn: float = 0.0) -> Camera:
    """The camera that shows all points, with a margin.

    Parameters
    ----------
    points : (n, 3) [m]
    dim : 2 or 3, the scene's dimension
    upward : (3,) the way up of a 3D scene
    turn : angle of the camera about a 3D scene, from the front to its right [degrees]
    """
    if dim == 2:
        right, up, towards = np.eye(3)
    else:
        upward = upward / np.linalg.norm(upward)
        front = front_of(upward)  # turned a little and from above, to show depth
        c, s = np.cos(np.radians(turn + 23.0)), np.sin(np.radians(turn + 23.0))
        towards = 0.94 * (c * front + s * np.cross(upward, front)) + 0.34 * upward
        towards /= np.linalg.norm(towards)
        right = np.cross(upward, towards) / np.linalg.norm(np.cross(upward, towards))
        up = np.cross(towards, right)
    seen = points @ np.column_stack([right, up, towards])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    aspect = float(np.clip(half[0] / half[1], 0.62, 1.5))
    half_height = MARGIN * max(half[1], half[0] / aspect)
    # The smallest distance at which every point is within the view angle, near ones included.
    focus = np.column_stack([right, up, towards]) @ middle
    x, y, z = (seen - middle).T
    slope = np.tan(np.radians(VIEW_ANGLE / 2)) / MARGIN
    distance = float((z + np.maximum(np.abs(y), np.abs(x) / aspect) / slope).max())
    return Camera(right, up, towards, focus, distance, float(half_height), float(2 * np.linalg.norm(half)), aspect)
