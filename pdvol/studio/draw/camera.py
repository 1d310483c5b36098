"""The camera: one for all the moments and levels of a picture, so that they can be compared. It may follow a body."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.framing import framed_points, outermost
from pdvol.studio.draw.views import STANDARD_VIEW, View
from pdvol.studio.shown import upward

VIEW_ANGLE = 24.0  # degrees from the picture's lower to its upper edge: small, so that shapes are hardly distorted
MARGIN = 1.08  # the picture's half height over that of its content
NARROWEST, WIDEST = 0.62, 1.5  # width over height of a picture whose shape follows its content
FRAMED_STEPS = 60  # steps of a level at which its content is measured: a film of a second shows little more
FOLLOW_SECONDS = 0.15  # width of the bell curve that smooths a followed body's path: impacts do not jerk the camera
FOLLOW_SIZE = 2.5  # a followed body's sizes that a picture is high: its surroundings show how it moves


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
    dim : the scene's dimension
    """

    right: np.ndarray
    up: np.ndarray
    towards: np.ndarray
    focus: np.ndarray
    distance: float
    half_height: float
    size: float
    aspect: float
    dim: int

    @property
    def position(self) -> np.ndarray:
        """(3,) [m]."""
        return self.focus + self.distance * self.towards

    def set_up(self, camera: Any) -> None:
        """Give a pyvista camera this position, direction and field of view."""
        camera.focal_point, camera.up, camera.position = self.focus, self.up, self.position
        camera.view_angle, camera.parallel_projection = VIEW_ANGLE, self.dim == 2
        camera.parallel_scale = self.half_height
        camera.clipping_range = (0.05 * self.distance, self.distance + 20 * self.size)


def cameras_of_run(
    run: Run, levels: Sequence[RunLevel], steps: Sequence[int], view: View = STANDARD_VIEW, aspect: float | None = None
) -> list[Camera]:
    """A camera for each of the steps, which may repeat. It shows what is in the scene most of the time (`framing.py`)
    at these steps on all these levels, or follows a body.

    Parameters
    ----------
    run : gives the way up and the obstacles; `levels` may be of several runs
    view : direction, position, or body to follow
    aspect : width over height; chosen from the content when None

    Raises
    ------
    InputError
        The body to follow is none of the run's, or the view is not one of a scene of this dimension.
    """
    dim = levels[0].rest.shape[1]
    if dim == 2 and (view.rise, view.position) != (STANDARD_VIEW.rise, None):
        raise InputError("a 2D scene is seen from the front only; leave --camera out, or follow a body")
    points, up = content_of_run(levels, steps, run.obstacles), upward(run)
    if view.position is not None:
        return [_placed_camera(points, up, view, aspect)] * len(steps)
    camera = fitted_camera(points, dim, up, view, aspect)
    return _following(camera, run, levels, steps, view.body) if view.body else [camera] * len(steps)


def content_of_run(levels: Sequence[RunLevel], steps: Sequence[int], obstacles: Sequence[DrawnObstacle]) -> np.ndarray:
    """The points (n, 3) [m] to frame, measured at no more than `FRAMED_STEPS` of the steps."""
    chosen = np.unique(np.asarray(steps))
    chosen = chosen[np.unique(np.linspace(0, len(chosen) - 1, FRAMED_STEPS).round().astype(int))]
    numbers, samples = [], []
    for level in levels:
        surface = np.unique(level.surface)
        owners = level.mesh.point_bodies[surface]
        bodies = {int(body): surface[owners == body] for body in np.unique(owners)}
        for step in chosen[chosen < level.steps]:
            positions = in_3d(level.positions(int(step)))
            numbers += list(bodies)
            samples += [outermost(positions[mine]) for mine in bodies.values()]
    places = (
        in_3d(obstacle.vertices(int(step)))
        for obstacle in obstacles
        if obstacle.kind != "plane"
        for step in (chosen if "positions" in obstacle.arrays else chosen[:1])
    )
    return framed_points(numbers, samples, places)


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
    points: np.ndarray, dim: int, upward: np.ndarray, view: View = STANDARD_VIEW, aspect: float | None = None
) -> Camera:
    """The camera that shows all points, with a margin.

    Parameters
    ----------
    points : (n, 3) [m]
    dim : 2 or 3, the scene's dimension
    upward : (3,) the way up of a 3D scene
    view : gives the direction in a 3D scene
    aspect : width over height; chosen from the content when None
    """
    right, up, towards = np.eye(3) if dim == 2 else axes(upward, view.turn, view.rise)
    seen = points @ np.column_stack([right, up, towards])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    if aspect is None:
        aspect = float(np.clip(half[0] / half[1], NARROWEST, WIDEST))
    half_height = MARGIN * max(half[1], half[0] / aspect)
    focus, distance = np.column_stack([right, up, towards]) @ middle, _fitting_distance(seen - middle, aspect)
    return Camera(right, up, towards, focus, distance, float(half_height), float(2 * np.linalg.norm(half)), aspect, dim)


def smoothed_path(places: np.ndarray, width: float) -> np.ndarray:
    """A path (n, 3) smoothed with a bell curve of `width` samples; as it is where that is less than one sample.

    A straight path at constant speed stays as it is, up to its ends.
    """
    if width < 1.0 or len(places) < 2:
        return places
    reach = min(int(np.ceil(3 * width)), len(places) - 1)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / width) ** 2)
    longer = np.pad(places, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return np.column_stack([np.convolve(axis, weights / weights.sum(), mode="valid") for axis in longer.T])


def _fitting_distance(seen: np.ndarray, aspect: float) -> float:
    """The smallest distance [m] from the focus at which points (n, 3) [m], along the camera's axes from the focus, are
    within the view angle, near ones included.
    """
    x, y, z = seen.T
    slope = np.tan(np.radians(VIEW_ANGLE / 2)) / MARGIN
    return float((z + np.maximum(np.abs(y), np.abs(x) / aspect) / slope).max())


def _placed_camera(points: np.ndarray, upward: np.ndarray, view: View, aspect: float | None) -> Camera:
    """The camera at the view's position that looks at its target; its picture is landscape where no aspect is given."""
    position, target = np.array(view.position), np.array(view.target)
    distance = float(np.linalg.norm(position - target))
    towards, upward = (position - target) / distance, upward / np.linalg.norm(upward)
    right = np.cross(upward, towards)
    if np.linalg.norm(right) < 1e-6:  # straight from above or below
        right = axes(upward, 0.0, 0.0)[0]
    right /= np.linalg.norm(right)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    half_height = distance * float(np.tan(np.radians(VIEW_ANGLE / 2)))
    return Camera(right, np.cross(towards, right), towards, target, distance, half_height, size, aspect or WIDEST, 3)


def _following(camera: Camera, run: Run, levels: Sequence[RunLevel], steps: Sequence[int], body: str) -> list[Camera]:
    """The body's middle over all levels, smoothed over time, is the focus. The distance is the same at all steps."""
    names = list(run.info["bodies"])
    if body not in names:
        raise InputError(f"--camera: {run.path} has no body {body!r}; follow one of {', '.join(names)}")
    boxes = {step: _box(levels, step, names.index(body)) for step in set(steps)}
    middles = np.array([boxes[step].mean(axis=0) for step in steps])
    stride = float(np.mean(np.abs(np.diff(steps)))) if len(steps) > 1 else 0.0
    path = smoothed_path(middles, FOLLOW_SECONDS / (stride * run.dt) if stride else 0.0)
    frame, aspect = np.column_stack([camera.right, camera.up, camera.towards]), camera.aspect
    # The corners of the body's box, from the focus, at every step: all of them must fit, whatever the smoothing.
    corners = [np.array(list(product(*boxes[step].T))) - place for step, place in zip(steps, path, strict=True)]
    seen = np.concatenate(corners) @ frame
    size = max(float(np.linalg.norm(box[1] - box[0])) for box in boxes.values())
    half = MARGIN * float(np.maximum(np.abs(seen[:, 1]), np.abs(seen[:, 0]) / aspect).max())
    half = max(half, 0.5 * FOLLOW_SIZE * size)
    distance = _fitting_distance(np.vstack([seen, [0.0, half / MARGIN, 0.0]]), aspect)
    near = replace(camera, distance=distance, half_height=half, size=min(camera.size, 4 * size))
    return [replace(near, focus=place) for place in path]


def _box(levels: Sequence[RunLevel], step: int, body: int) -> np.ndarray:
    """Bounds (2, 3) [m] of a body at a step over all levels; a level that is not simulated so far shows its last."""
    shown = [in_3d(level.positions(min(step, level.steps - 1))[level.mesh.point_bodies == body]) for level in levels]
    return np.array([np.concatenate(shown).min(axis=0), np.concatenate(shown).max(axis=0)])
