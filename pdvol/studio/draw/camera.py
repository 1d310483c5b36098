"""The camera: one for all the moments and levels of a picture, so that they can be compared."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.framing import Sample, framed_points, outermost
from pdvol.studio.draw.views import STANDARD_VIEW, View
from pdvol.studio.shown import upward

VIEW_ANGLE = 24.0  # degrees from the picture's lower to its upper edge: small, so that shapes are hardly distorted
MARGIN = 1.08  # the picture's half height over that of its content
NARROWEST, WIDEST = 0.62, 1.5  # width over height of a picture whose shape follows its content
FRAMED_STEPS = 60  # steps of a level at which its content is measured: a film of a second shows little more


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

    def aimed_at(self, focus: np.ndarray) -> "Camera":
        """The same camera, moved so that another point (3,) [m] is in the middle."""
        return replace(self, focus=focus)

    def set_up(self, camera: Any, parallel: bool) -> None:
        """Give a pyvista camera this position, direction and field of view, in perspective or parallel projection."""
        camera.focal_point, camera.up, camera.position = self.focus, self.up, self.position
        camera.view_angle, camera.parallel_projection = VIEW_ANGLE, parallel
        camera.parallel_scale = self.half_height
        camera.clipping_range = (0.05 * self.distance, self.distance + 20 * self.size)


def camera_of_run(
    run: Run,
    levels: Sequence[RunLevel],
    steps: Sequence[int],
    obstacles: Sequence[DrawnObstacle],
    turn: float = 0.0,
    view: View = STANDARD_VIEW,
    aspect: float | None = None,
) -> Camera:
    """The camera that shows what is in the scene most of the time (`framing.py`) at these steps on all these levels.

    Parameters
    ----------
    turn : angle of the camera about a 3D scene, from the front to its right, added to the view's [degrees]
    view : direction, or position and target; a body to follow is not regarded here (`camera_path.py`)
    aspect : width over height; chosen from the content when None
    """
    points, dim = content_of_run(levels, steps, obstacles), levels[0].rest.shape[1]
    up = upward(run, obstacles)
    if view.position is not None and view.target is not None:
        return placed_camera(points, dim, up, view, aspect)
    return fitted_camera(points, dim, up, turn + view.turn - STANDARD_VIEW.turn, view.rise, aspect)


def content_of_run(levels: Sequence[RunLevel], steps: Sequence[int], obstacles: Sequence[DrawnObstacle]) -> np.ndarray:
    """The points (n, 3) [m] to frame, measured at no more than `FRAMED_STEPS` of the steps."""
    chosen = np.unique(np.asarray(steps))
    chosen = chosen[np.unique(np.linspace(0, len(chosen) - 1, FRAMED_STEPS).round().astype(int))]
    samples = []
    for level in levels:
        surface = np.unique(level.surface)
        owners = level.mesh.point_bodies[surface]
        bodies = {int(body): surface[owners == body] for body in np.unique(owners)}
        for step in chosen[chosen < level.steps]:
            positions = in_3d(level.positions(int(step)))
            samples += [Sample(body, outermost(positions[mine])) for body, mine in bodies.items()]
    shapes = [obstacle for obstacle in obstacles if obstacle.kind != "plane"]
    places = (
        in_3d(obstacle.vertices(int(step)))
        for obstacle in shapes
        for step in (chosen if "positions" in obstacle.arrays else chosen[:1])
    )
    return framed_points(samples, places)


def front_of(upward: np.ndarray) -> np.ndarray:
    """(3,) unit vector towards the front of a 3D scene, which is -y where z is up and +z where y is."""
    upward = upward / np.linalg.norm(upward)
    front = np.array([0.0, -1.0, 0.0]) if abs(upward[1]) < 0.7 else np.array([0.0, 0.0, 1.0])
    front -= (front @ upward) * upward
    return front / np.linalg.norm(front)


def axes(upward: np.ndarray, turn: float, rise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Unit vectors (3,) to the picture's right, up in it, and towards the camera, which looks at a 3D scene.

    Parameters
    ----------
    upward : (3,) the way up
    turn, rise : about the vertical from the front to the right, and above the horizontal [degrees]
    """
    upward = upward / np.linalg.norm(upward)
    front = front_of(upward)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    level = c * front + s * np.cross(upward, front)
    right = np.cross(upward, level)
    towards = np.cos(np.radians(rise)) * level + np.sin(np.radians(rise)) * upward
    return right, np.cross(towards, right), towards


def fitted_camera(
    points: np.ndarray,
    dim: int,
    upward: np.ndarray,
    turn: float = 0.0,
    rise: float = STANDARD_VIEW.rise,
    aspect: float | None = None,
) -> Camera:
    """The camera that shows all points, with a margin.

    Parameters
    ----------
    points : (n, 3) [m]
    dim : 2 or 3, the scene's dimension
    upward : (3,) the way up of a 3D scene
    turn : angle of the camera about a 3D scene, from the standard view to its right [degrees]
    rise : angle of the camera above the horizontal [degrees]
    aspect : width over height; chosen from the content when None
    """
    right, up, towards = np.eye(3) if dim == 2 else axes(upward, turn + STANDARD_VIEW.turn, rise)
    seen = points @ np.column_stack([right, up, towards])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    if aspect is None:
        aspect = float(np.clip(half[0] / half[1], NARROWEST, WIDEST))
    half_height = MARGIN * max(half[1], half[0] / aspect)
    focus = np.column_stack([right, up, towards]) @ middle
    distance = fitting_distance(seen - middle, aspect)
    return Camera(right, up, towards, focus, distance, float(half_height), float(2 * np.linalg.norm(half)), aspect)


def fitting_distance(seen: np.ndarray, aspect: float) -> float:
    """The smallest distance [m] from the focus at which all points are within the view angle, near ones included.

    Parameters
    ----------
    seen : (n, 3) [m], along the camera's axes, from the focus
    """
    x, y, z = seen.T
    slope = np.tan(np.radians(VIEW_ANGLE / 2)) / MARGIN
    return float((z + np.maximum(np.abs(y), np.abs(x) / aspect) / slope).max())


def placed_camera(points: np.ndarray, dim: int, upward: np.ndarray, view: View, aspect: float | None = None) -> Camera:
    """The camera at the view's position that looks at its target; its picture is landscape where no aspect is given.

    Raises
    ------
    InputError
        The scene is 2D.
    """
    if dim == 2:
        raise InputError("a 2D scene has no camera position; leave --camera out, or follow a body: follow:BODY")
    position, target = np.array(view.position), np.array(view.target)
    distance = float(np.linalg.norm(position - target))
    towards, upward = (position - target) / distance, upward / np.linalg.norm(upward)
    right = np.cross(upward, towards)
    if np.linalg.norm(right) < 1e-6:  # straight from above or below
        right = axes(upward, 0.0, 0.0)[0]
    right /= np.linalg.norm(right)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    half_height = distance * float(np.tan(np.radians(VIEW_ANGLE / 2)))
    return Camera(right, np.cross(towards, right), towards, target, distance, half_height, size, aspect or WIDEST)
