"""Motions of supports and obstacles: callables (X, t) -> x from rest positions (n, d) [m] and time [s]."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pdvol.scene.checks import anything, ascending, called, direction, finite, moment, require, sequence, takes, vector
from pdvol.scene.element import NOT_SIMULATED, Element
from pdvol.scene.hand import Hand
from pdvol.scene.values import Vector, as_many, interpolated

Motion = Callable[[np.ndarray, float], np.ndarray]


@dataclass(frozen=True, repr=False)
class Still(Element):
    """No motion."""

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X


@dataclass(frozen=True, repr=False)
class Translation(Element):
    """Constant velocity [m/s], until `stop` [s].

    Attributes
    ----------
    velocity : (d,) [m/s]
    stop : time [s] from which on it rests; inf: never
    """

    velocity: Vector
    stop: float = np.inf

    checks = {"velocity": vector, "stop": moment}

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return X + min(t, self.stop) * np.asarray(self.velocity, dtype=float)


@dataclass(frozen=True, repr=False)
class Rotation(Element):
    """Constant angular speed [rad/s] about an axis through a centre, until `stop` [s]. In 2D it is clockwise where the
    axis has a negative last component.

    Attributes
    ----------
    speed : [rad/s]
    centre : (d,) [m]
    axis : (3,) direction, of any length but zero
    stop : time [s] from which on it rests; inf: never
    """

    speed: float
    centre: Vector
    axis: Vector = (0.0, 0.0, 1.0)
    stop: float = np.inf

    checks = {"speed": finite, "centre": vector, "axis": direction, "stop": moment}

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        turn = rotation_matrix(self.speed * min(t, self.stop), self.axis, X.shape[1])
        return (X - np.asarray(self.centre, dtype=float)) @ turn.T + np.asarray(self.centre, dtype=float)


@dataclass(frozen=True, repr=False)
class Path(Element):
    """Translation along keyframes: at `times[i]` [s] the displacement is `points[i]` [m]; still before the first and
    after the last.

    Attributes
    ----------
    times : (k,) ascending
    points : (k, d) one per time, two or three components each
    smooth : straight and even in between, or a natural cubic spline (continuous accelerations)
    """

    times: Vector
    points: Sequence[Vector] | np.ndarray
    smooth: bool = False

    checks = {"times": ascending, "points": sequence, "smooth": anything}

    def __post_init__(self) -> None:
        super().__post_init__()
        as_many(self, "times", "points")
        for point in self.points:
            vector("Path.points", point)
        require(len({len(p) for p in self.points}) == 1, "Path.points must all have two or all three components")

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        times, points = np.asarray(self.times, dtype=float), np.asarray(self.points, dtype=float)
        t = min(max(t, times[0]), times[-1])
        if self.smooth:
            from scipy.interpolate import CubicSpline

            return X + CubicSpline(times, points, bc_type="natural")(t)
        return X + interpolated(t, times, points)


@dataclass(frozen=True, repr=False)
class Sequential(Element):
    """Motions applied one after the other at the same time: `Sequential((Rotation(...), Path(...)))` turns, and carries
    what has turned.

    Attributes
    ----------
    motions : sequence of callables (X, t) -> x, the first of which is applied first
    """

    motions: Sequence[Motion]

    checks = {"motions": sequence}

    def __post_init__(self) -> None:
        super().__post_init__()
        for number, motion in enumerate(self.motions):
            require(callable(motion), "Sequential.motions must be motions, callables (X, t) -> x")
            takes(f"Sequential.motions[{number}]", motion, "X", "t")

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        for motion in self.motions:
            X = motion(X, t)
        return X


@dataclass(frozen=True, repr=False)
class Led(Element):
    """A motion that a hand shifts, by offsets that are straight and even between the ends of steps.

    Attributes
    ----------
    own : the scripted motion
    name : of what moves, in the hand's record
    hand : Hand
    dt : length of a step [s]
    """

    own: Motion
    name: str
    hand: Hand = field(metadata={NOT_SIMULATED: True})
    dt: float = field(metadata={NOT_SIMULATED: True})

    def offset(self, t: float, dim: int) -> np.ndarray:
        """(dim,) [m] at a time [s]; where a step ends, the record's to the last bit."""
        at = lambda step: np.asarray(self.hand.line(step)["obstacles"].get(self.name, np.zeros(dim)), dtype=float)
        step = round(t / self.dt)
        if step * self.dt == t:
            return at(step)
        share, before = math.modf(t / self.dt)
        return (1.0 - share) * at(int(before)) + share * at(int(before) + 1)

    def __call__(self, X: np.ndarray, t: float) -> np.ndarray:
        return self.own(X, t) + self.offset(t, X.shape[1])


def stands(motion: Any) -> bool:
    """Whether a motion is none, as it is scripted."""
    return isinstance(motion.own if isinstance(motion, Led) else motion, Still)


def keeps_shape(motion: Any) -> bool:
    """Whether a motion is known to move what it moves rigidly. Of users' own motions nothing is known."""
    if type(motion) is Led:
        return keeps_shape(motion.own)
    if type(motion) is Sequential:
        return all(keeps_shape(part) for part in motion.motions)
    return type(motion) in (Still, Translation, Rotation, Path)


def moved(motion: Motion, X: np.ndarray, t: float, whose: str) -> np.ndarray:
    """(n, d) [m]: where a motion takes X (n, d) by time t [s]. One of the user's own is checked at each time. Those of
    this file fit X at all times if they do at the first one.

    Raises
    ------
    InputError
        It fails, or gives another shape, NaN or infinity; `whose` names it, as in "obstacle 'paddle'".
    """
    if t > 0.0 and keeps_shape(motion):
        return motion(X, t)
    x = called(f"{whose}: its motion at t = {t:g} s", lambda: np.asarray(motion(X.copy(), t), dtype=float), (), X.shape)
    require(bool(np.isfinite(x).all()), f"{whose}: its motion gives NaN or infinity at t = {t:g} s")
    return x


def rotation_matrix(angle: float, axis: Vector, dim: int) -> np.ndarray:
    """Rotation by `angle` [rad], shape (dim, dim); in 3D Rodrigues' formula, in 2D clockwise for axes (0, 0, -1)."""
    c, s = np.cos(angle), np.sin(angle)
    if dim == 2:
        s = -s if any(part < 0.0 for part in axis[2:]) else s
        return np.array([[c, -s], [s, c]])
    n = np.asarray(axis, dtype=float) / np.linalg.norm(axis)
    K = np.array([[0, -n[2], n[1]], [n[2], 0, -n[0]], [-n[1], n[0], 0]])
    return np.eye(3) + s * K + (1 - c) * K @ K
