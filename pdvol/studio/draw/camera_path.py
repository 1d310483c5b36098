"""The camera of each picture of a run: fixed, or following a body."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pdvol.errors import InputError
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import in_3d
from pdvol.studio.draw.camera import (
    MARGIN,
    Camera,
    camera_of_run,
    fitting_distance,
)
from pdvol.studio.draw.views import STANDARD_VIEW, View

FOLLOW_SECONDS = 0.15  # width of the bell curve that smooths a followed body's path: impacts do not jerk the camera
FOLLOW_SIZE = 2.5  # a followed body's sizes that a picture is high: its surroundings show how it moves


def cameras_of_run(
    run: Run,
    levels: Sequence[RunLevel],
    steps: Sequence[int],
    obstacles: Sequence[DrawnObstacle],
    turn: float = 0.0,
    view: View = STANDARD_VIEW,
    aspect: float | None = None,
) -> list[Camera]:
    """A camera for each of the steps, which may repeat.

    Parameters
    ----------
    turn : added to the view's angle about the vertical [degrees]
    view : direction, position, or body to follow
    aspect : width over height; chosen from the content when None

    Raises
    ------
    InputError
        The body to follow is none of the run's, or the view is not one of a scene of this dimension.
    """
    dim = levels[0].rest.shape[1]
    if dim == 2 and view not in (STANDARD_VIEW, View(body=view.body)):
        raise InputError("a 2D scene is seen from the front only; leave --camera out, or follow a body")
    if view.body:
        return _following(run, levels, steps, obstacles, turn, view, aspect)
    return [camera_of_run(run, levels, steps, obstacles, turn, view, aspect)] * len(steps)


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


def _following(
    run: Run,
    levels: Sequence[RunLevel],
    steps: Sequence[int],
    obstacles: Sequence[DrawnObstacle],
    turn: float,
    view: View,
    aspect: float | None,
) -> list[Camera]:
    """The body's middle over all levels, smoothed over time, is the focus. The distance is the same at all steps."""
    names = list(run.info["bodies"])
    if view.body not in names:
        raise InputError(f"--camera: {run.path} has no body {view.body!r}; follow one of {', '.join(names)}")
    number = names.index(view.body)
    boxes = {step: _box(levels, step, number) for step in set(steps)}
    middles = np.array([boxes[step].mean(axis=0) for step in steps])
    stride = float(np.mean(np.abs(np.diff(steps)))) if len(steps) > 1 else 0.0
    path = smoothed_path(middles, FOLLOW_SECONDS / (stride * run.dt) if stride else 0.0)
    base = camera_of_run(run, levels, steps, obstacles, turn, replace(view, body=""), aspect)
    frame = np.column_stack([base.right, base.up, base.towards])
    # The corners of the body's box, from the focus, at every step: all of them must fit, whatever the smoothing.
    corners = np.concatenate([(_corners(boxes[step]) - place) @ frame for step, place in zip(steps, path, strict=True)])
    size = max(float(np.linalg.norm(box[1] - box[0])) for box in boxes.values())
    aspect = base.aspect if aspect is None else aspect
    half = MARGIN * float(np.maximum(np.abs(corners[:, 1]), np.abs(corners[:, 0]) / aspect).max())
    half = max(half, 0.5 * FOLLOW_SIZE * size)
    highest = np.array([[0.0, half / MARGIN, 0.0]])
    distance = max(fitting_distance(corners, aspect), fitting_distance(highest, aspect))
    camera = replace(base, distance=distance, half_height=half, size=min(base.size, 4 * size), aspect=aspect)
    return [camera.aimed_at(place) for place in path]


def _box(levels: Sequence[RunLevel], step: int, body: int) -> np.ndarray:
    """Bounds (2, 3) [m] of a body at a step over all levels; a level that is not simulated so far shows its last."""
    lows, highs = [], []
    for level in levels:
        positions = in_3d(level.positions(min(step, level.steps - 1))[level.mesh.point_bodies == body])
        lows.append(positions.min(axis=0))
        highs.append(positions.max(axis=0))
    return np.array([np.min(lows, axis=0), np.max(highs, axis=0)])


def _corners(box: np.ndarray) -> np.ndarray:
    """The corners (8, 3) of a box (2, 3)."""
    return np.array([(box[i, 0], box[j, 1], box[k, 2]) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
