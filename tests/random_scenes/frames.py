"""The same scene in other units, from elsewhere, turned, in a mirror, and in motion."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

import pdvol
from pdvol.meshes import Outline


@dataclass(frozen=True)
class Frame:
    """Points X become length * turn X + offset; times and masses are multiplied by `time` and `mass`.

    Attributes
    ----------
    turn : (d, d) rotation, or a rotation of the mirror image
    offset : (d,) in the new unit of length
    """

    turn: np.ndarray
    offset: np.ndarray
    length: float = 1.0
    mass: float = 1.0
    time: float = 1.0

    @property
    def dim(self) -> int:
        return len(self.offset)

    def points(self, X: np.ndarray) -> np.ndarray:
        return self.length * self.directions(X) + self.offset

    def back(self, X: np.ndarray) -> np.ndarray:
        return ((X - self.offset) / self.length) @ self.turn

    def directions(self, v: np.ndarray) -> np.ndarray:
        # Products with the unit matrix would not change a bit, but for the sign of zeros.
        v = np.asarray(v, dtype=float)
        return v if np.array_equal(self.turn, np.eye(self.dim)) else v @ self.turn.T

    @property
    def hand(self) -> int:
        """-1 in a mirror: what turns to the left turns to the right."""
        return 1 if np.linalg.det(self.turn) > 0.0 else -1

    def corners(self, simplices: np.ndarray) -> np.ndarray:
        """Simplices (k, n) with the same orientation in a mirror."""
        return simplices if self.hand > 0 else np.ascontiguousarray(simplices[:, [1, 0, *range(2, simplices.shape[1])]])

    def unit(self, quantity: str) -> float:
        """What a quantity is multiplied by. Stress and density are per area in 2D."""
        mass, length, time = {
            "number": (0, 0, 0),
            "length": (0, 1, 0),
            "time": (0, 0, 1),
            "velocity": (0, 1, -1),
            "acceleration": (0, 1, -2),
            "force": (1, 1, -2),
            "stiffness": (1, 0, -2),
            "stress": (1, 2 - self.dim, -2),
            "density": (1, -self.dim, 0),
        }[quantity]
        return self.mass**mass * self.length**length * self.time**time


def seen(scene: pdvol.Scene, frame: Frame) -> pdvol.Scene:
    """The scene from a frame. Shapes are placed by this module, so placements are compared with those of pdvol."""
    parts = ("bodies", "loads", "supports", "obstacles", "contact", "attachments", "muscles", "pulls")
    solver = replace(scene.solver, tolerance=speed(scene.solver.tolerance, frame))
    put_all = {name: tuple(put(item, frame) for item in getattr(scene, name)) for name in parts}
    return replace(scene, dt=frame.time * scene.dt, solver=solver, **put_all)


def put(thing, frame: Frame):
    """A part of a scene from a frame, by the rules of its class."""
    kind = next(kind for kind in type(thing).__mro__ if kind in RULES)
    thing = placed(thing) if hasattr(thing, "placement") else thing
    return replace(thing, **{name: rule(getattr(thing, name), frame) for name, rule in RULES[kind].items()})


def placed(thing):
    """A part of a scene with its placement within its shape."""
    move = lambda points: thing.placement(np.asarray(points, dtype=float))

    def moved(shape):
        if isinstance(shape, tuple):
            return tuple(map(moved, shape))
        name = "points" if isinstance(shape, Outline) else "vertices"
        return None if shape is None else replace(shape, **{name: move(getattr(shape, name))})

    if isinstance(thing, pdvol.PointCache):
        return replace(thing, source=np.array([move(points) for points in thing.source]), placement=pdvol.Placement())
    return replace(thing, shape=moved(thing.shape), placement=pdvol.Placement())


# ---- rules: (value, frame) -> the value from the frame


def scaled(value, frame: Frame, by: Callable):
    """A constant, `Keyed` ones, or a function of time that gives it; `by` has the constant's rule."""
    if isinstance(value, pdvol.Keyed):
        return pdvol.Keyed(timed(value.times, frame), [by(each) for each in value.values])
    if callable(value):
        return lambda t: by(value(t / frame.time))
    return by(value)


def vector(quantity: str) -> Callable:
    """Of a direction with a unit; nothing stays nothing."""
    rule = lambda v, frame: tuple(frame.unit(quantity) * frame.directions(v)) if len(v) else ()
    return lambda value, frame: scaled(value, frame, lambda v: rule(v, frame))


def number(quantity: str) -> Callable:
    return lambda value, frame: scaled(value, frame, lambda each: frame.unit(quantity) * each)


def field(quantity: str) -> Callable:
    """Of a number, or a function of rest positions that gives one each."""

    def rule(value, frame):
        if isinstance(value, pdvol.Keyed) or not callable(value):
            return number(quantity)(value, frame)
        return lambda X: frame.unit(quantity) * value(frame.back(X))

    return rule


def each(rule: Callable) -> Callable:
    return lambda values, frame: tuple(rule(value, frame) for value in values)


def optional(rule: Callable) -> Callable:
    return lambda value, frame: None if value is None else rule(value, frame)


def mask(where, frame: Frame):
    return (lambda X: where(frame.back(X))) if callable(where) else where


def timed(times, frame: Frame) -> tuple:
    return tuple(frame.time * t for t in times)


def length(value, frame: Frame):
    return value if isinstance(value, pdvol.Relative) else frame.length * value


def speed(value, frame: Frame):
    """A `Relative` one is a fraction of a length in a second."""
    if isinstance(value, pdvol.Relative):
        return pdvol.Relative(value.fraction / frame.time)
    return frame.unit("velocity") * value


def point(value, frame: Frame) -> tuple:
    return tuple(frame.points(np.array([value]))[0])


def corners(simplices, frame: Frame):
    return frame.corners(np.asarray(simplices))


def axis(value, frame: Frame):
    return value if frame.dim == 2 else tuple(frame.directions(value))


def moving(motion, frame: Frame):
    """Of a motion of pdvol, or a user's own."""
    if type(motion) in RULES:
        return put(motion, frame)
    return lambda X, t: frame.points(motion(frame.back(X), t / frame.time))


def initial(velocity, frame: Frame):
    if callable(velocity):
        return lambda X: frame.unit("velocity") * frame.directions(velocity(frame.back(X)))
    return vector("velocity")(velocity, frame)


def spin(value, frame: Frame):
    value = frame.hand * np.asarray(value, dtype=float) / frame.time
    return float(value) if value.ndim == 0 else tuple(frame.directions(value)) if len(value) else ()


def start(function, frame: Frame):
    return lambda X: frame.points(function(frame.back(X)))


RULES: dict[type, dict[str, Callable]] = {
    pdvol.Solid: {"vertices": lambda X, frame: frame.points(X), "cells": corners},
    pdvol.Surface: {"vertices": lambda X, frame: frame.points(X), "triangles": corners},
    Outline: {"points": lambda X, frame: frame.points(X)[:: frame.hand]},
    pdvol.Body: {
        "shape": each(put),
        "material": put,
        "velocity": initial,
        "spin": spin,
        "regions": each(put),
        "start": optional(start),
    },
    pdvol.Material: {
        "young": field("stress"),
        "poisson": field("number"),
        "density": field("density"),
        "damping": field("time"),
    },
    pdvol.Region: {"material": put, "where": mask},
    pdvol.Still: {},
    pdvol.Translation: {"velocity": vector("velocity"), "stop": number("time")},
    pdvol.Rotation: {
        "speed": lambda value, frame: frame.hand * value / frame.time,
        "centre": point,
        "axis": axis,
        "stop": number("time"),
    },
    pdvol.Path: {"times": timed, "points": each(vector("length"))},
    pdvol.Sequential: {"motions": each(moving)},
    pdvol.PointCache: {
        "source": lambda frames, frame: np.array([frame.points(X) for X in frames]),
        "faces": optional(corners),
        "times": timed,
        "begin": number("time"),
    },
    pdvol.Plane: {"point": point, "normal": vector("number"), "motion": moving},
    pdvol.Rigid: {"shape": put, "motion": moving},
    pdvol.Deforming: {"shape": optional(put), "motion": put},
    pdvol.Support: {"where": mask, "motion": moving, "release": number("time")},
    pdvol.Gravity: {"acceleration": vector("acceleration")},
    pdvol.Force: {"force": vector("force"), "where": mask},
    pdvol.PointForce: {"force": vector("force"), "at": point},
    pdvol.Impulse: {"velocity": vector("velocity"), "time": number("time"), "where": mask},
    pdvol.Flow: {"velocity": vector("velocity"), "density": number("density")},
    pdvol.Pressure: {"pressure": number("stress")},
    pdvol.Muscle: {
        "fibre": vector("number"),
        "strength": number("stress"),
        "activation": number("number"),
        "where": mask,
    },
    pdvol.Attachment: {
        "where": mask,
        "to": mask,
        "stiffness": number("stiffness"),
        "rest_length": optional(number("length")),
        "breaking": optional(number("force")),
    },
    pdvol.Pull: {
        "where": point,
        "times": timed,
        "points": each(point),
        "stiffness": number("stiffness"),
        "radius": number("length"),
    },
    pdvol.Barrier: {"dhat": length},
    pdvol.Friction: {"eps_v": speed},
}
"""The rule of each quantity that a frame changes, by class and name."""


# ---- from a moving frame


def drifting(scene: pdvol.Scene, velocity: np.ndarray) -> pdvol.Scene:
    """The scene with a velocity [m/s] added to everything; without animated obstacles, which rest after their last
    frame.
    """
    u = np.asarray(velocity, dtype=float)
    along = pdvol.Translation(tuple(u))

    def driven(motion):
        return along if isinstance(motion, pdvol.Still) else pdvol.Sequential((motion, along))

    def moved(body: pdvol.Body) -> pdvol.Body:
        own = body.velocity
        if callable(own):
            return replace(body, velocity=lambda X: own(X) + u)
        return replace(body, velocity=tuple(u + np.array(own or (0.0,) * len(u))))

    def blown(load):
        return replace(load, velocity=tuple(u + np.array(load.velocity))) if isinstance(load, pdvol.Flow) else load

    return replace(
        scene,
        bodies=tuple(moved(body) for body in scene.bodies),
        supports=tuple(replace(each, motion=driven(each.motion)) for each in scene.supports),
        obstacles=tuple(replace(each, motion=driven(each.motion)) for each in scene.obstacles),
        loads=tuple(blown(load) for load in scene.loads),
        pulls=tuple(replace(p, points=np.array(p.points) + np.outer(p.times, u)) for p in scene.pulls),
    )
