"""From where a scene is seen: one view for all the moments and levels of a picture, so that they can be compared."""

from dataclasses import dataclass

import numpy as np

ANGLE = 24.0  # the camera's opening [degrees]: a long lens, which flatters


@dataclass(frozen=True, eq=False)
class View:
    """Where everything is seen from.

    Attributes
    ----------
    right, up, towards : (3,) float64
        The picture's axes; `towards` points at the camera.
    focus : (3,) float64 [m]
    distance : float [m]
        Of the camera from the focus; 2D scenes are seen in parallel projection.
    half_height : float [m]
        Half of the picture's height at the focus.
    size : float [m]
        The diagonal of what is to be seen.
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


def lifted(points: np.ndarray) -> np.ndarray:
    """Points with a zero third coordinate in 2D, shape (n, 3)."""
    return np.pad(np.asarray(points, dtype=float), ((0, 0), (0, 3 - np.shape(points)[1])))


def view_of(points: np.ndarray, dim: int, upward: np.ndarray, turn: float = 0.0) -> View:
    """A view that holds all `points` (n, 3) [m] with a little room.

    `upward` (3,) is the way up of a 3D scene, and `turn` [degrees] walks round it, from the front to its right.
    """
    if dim == 2:
        right, up, towards = np.eye(3)
    else:
        upward = upward / np.linalg.norm(upward)
        # Seen from the front, which is -y where z is up and +z where y is, turned a little and from above to show
        # depth.
        front = np.array([0.0, -1.0, 0.0]) if abs(upward[1]) < 0.7 else np.array([0.0, 0.0, 1.0])
        front -= (front @ upward) * upward
        front /= np.linalg.norm(front)
        c, s = np.cos(np.radians(turn + 23.0)), np.sin(np.radians(turn + 23.0))
        towards = 0.94 * (c * front + s * np.cross(upward, front)) + 0.34 * upward
        towards /= np.linalg.norm(towards)
        right = np.cross(upward, towards) / np.linalg.norm(np.cross(upward, towards))
        up = np.cross(towards, right)
    seen = points @ np.column_stack([right, up, towards])
    low, high = seen.min(axis=0), seen.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    aspect = float(np.clip(half[0] / half[1], 0.62, 1.5))
    half_height = 1.08 * max(half[1], half[0] / aspect)
    # The nearest distance from which the lens holds every point, near ones included.
    focus = np.column_stack([right, up, towards]) @ middle
    x, y, z = (seen - middle).T
    slope = np.tan(np.radians(ANGLE / 2)) / 1.08
    distance = float((z + np.maximum(np.abs(y), np.abs(x) / aspect) / slope).max())
    return View(right, up, towards, focus, distance, float(half_height), float(2 * np.linalg.norm(half)), aspect)
