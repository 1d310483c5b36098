"""Motions of supports and obstacles: callables (X, t) -> x."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

Vector = Sequence[float]


@dataclass(frozen=True)
class Still:
    """No motion."""

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X


@dataclass(frozen=True)
class Translation:
    """Constant velocity [m/s], until `stop` [s]."""

    velocity: tuple[float, ...]
    stop: float = np.inf

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X + min(t, self.stop) * np.asarray(self.velocity, dtype=float)


@dataclass(frozen=True)
class Rotation:
    """Constant angular speed [rad/s] about an axis through a centre, until `stop` [s]. In 2D the axis is the plane's normal."""

    speed: float
    centre: tuple[float, ...]
    axis: tuple[float, ...] = (0.0, 0.0, 1.0)
    stop: float = np.inf

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        turn = rotation_matrix(self.speed * min(t, self.stop), self.axis, X.shape[1])
        return (X - np.asarray(self.centre, dtype=float)) @ turn.T + np.asarray(self.centre, dtype=float)


Motion = Callable[[np.ndarray, float], np.ndarray]


def rotation_matrix(angle: float, axis: Vector, dim: int) -> np.ndarray:
    """Rotation by `angle` [rad], shape (dim, dim); Rodrigues' formula in 3D."""
    c, s = np.cos(angle), np.sin(angle)
    if dim == 2:
        return np.array([[c, -s], [s, c]])
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + s * K + (1 - c) * K @ K
