"""The same scene in other units, from elsewhere, turned, in a mirror, and in motion."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import singledispatch

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

    def unit(self, mass: int = 0, length: int = 0, time: int = 0) -> float:
        """What a quantity of these dimensions is multiplied by."""
        return self.mass**mass * self.length**length * self.time**time

    @property
    def stress(self) -> float:
        """Of energy per volume: per area in 2D."""
        return self.unit(1, 2 - self.dim, -2)

    @property
    def density(self) -> float:
        return self.unit(1, -self.dim)


def seen(scene: pdvol.Scene, frame: Frame) -> pdvol.Scene:
    """The scene from a frame. Shapes are placed by this module, so placements are compared with those of pdvol."""
    parts = ("bodies", "loads", "supports", "obstacles", "contact", "attachments", "muscles", "pulls")
    solver = replace(scene.solver, tolerance=speed(scene.solver.tolerance, frame))
    put_all = {name: tuple(put(item, frame) for item in getattr(scene, name)) for name in parts}
    return replace(scene, dt=frame.time * scene.dt, solver=solver, **put_all)


def scaled(value, frame: Frame, by: Callable):
    """A constant, `Keyed` ones, or a function of time that gives it; `by` has the constant's rule."""
    if isinstance(value, pdvol.Keyed):
        return pdvol.Keyed(timed(value.times, frame), [by(each) for each in value.values])
    if callable(value):
        return lambda t: by(value(t / frame.time))
    return by(value)


def vector(value, frame: Frame, factor: float):
    """A direction with a unit."""
    return scaled(value, frame, lambda v: tuple(factor * frame.directions(v)))


def number(value, frame: Frame, factor: float):
    return scaled(value, frame, lambda each: factor * each)


def field(value, frame: Frame, factor: float):
    """A number, or a function of rest positions that gives one each."""
    if isinstance(value, pdvol.Keyed) or not callable(value):
        return number(value, frame, factor)
    return lambda X: factor * value(frame.back(X))


def mask(where: Callable, frame: Frame) -> Callable:
    return lambda X: where(frame.back(X))


def timed(times, frame: Frame) -> tuple:
    return tuple(frame.time * t for t in times)


def length(value, frame: Frame):
    return value if isinstance(value, pdvol.Relative) else frame.length * value


def speed(value, frame: Frame):
    """A `Relative` one is a fraction of a length in a second."""
    if isinstance(value, pdvol.Relative):
        return pdvol.Relative(value.fraction / frame.time)
    return frame.unit(0, 1, -1) * value


@singledispatch
def put(thing, frame: Frame):
    """A part of a scene from a frame."""
    raise TypeError(f"{type(thing).__name__} has no rule")


@put.register
def _(shape: pdvol.Solid, frame):
    return pdvol.Solid(frame.points(shape.vertices), frame.corners(shape.cells), shape.regions)


@put.register
def _(shape: pdvol.Surface, frame):
    return pdvol.Surface(frame.points(shape.vertices), frame.corners(shape.triangles))


@put.register
def _(shape: Outline, frame):
    return Outline(frame.points(shape.points)[:: frame.hand])


def placed(shape, placement: pdvol.Placement, frame: Frame):
    """A shape where a placement puts it, from a frame."""
    points = shape.points if isinstance(shape, Outline) else shape.vertices
    moved = placement(np.asarray(points, dtype=float))
    old = replace(shape, points=moved) if isinstance(shape, Outline) else replace(shape, vertices=moved)
    return put(old, frame)


@put.register
def _(body: pdvol.Body, frame):
    spin = frame.hand * np.asarray(body.spin, dtype=float) / frame.time
    velocity = body.velocity
    shape = tuple(placed(each, body.placement, frame) for each in body.shape)
    if callable(velocity):
        moving = lambda X: frame.unit(0, 1, -1) * frame.directions(velocity(frame.back(X)))
    else:
        moving = vector(velocity, frame, frame.unit(0, 1, -1)) if len(velocity) else ()
    return replace(
        body,
        shape=shape,
        placement=pdvol.Placement(),
        material=put(body.material, frame),
        velocity=moving,
        spin=float(spin) if spin.ndim == 0 else tuple(frame.directions(spin)) if len(spin) else (),
        regions=tuple(put(region, frame) for region in body.regions),
        start=None if body.start is None else lambda X: frame.points(body.start(frame.back(X))),
    )


@put.register
def _(material: pdvol.Material, frame):
    return replace(
        material,
        young=field(material.young, frame, frame.stress),
        poisson=field(material.poisson, frame, 1.0),
        density=field(material.density, frame, frame.density),
        damping=field(material.damping, frame, frame.time),
    )


@put.register
def _(region: pdvol.Region, frame):
    return pdvol.Region(
        put(region.material, frame), mask(region.where, frame) if callable(region.where) else region.where
    )


# ---- motions


@put.register
def _(motion: pdvol.Still, frame):
    return motion


@put.register
def _(motion: pdvol.Translation, frame):
    return pdvol.Translation(vector(motion.velocity, frame, frame.unit(0, 1, -1)), frame.time * motion.stop)


@put.register
def _(motion: pdvol.Rotation, frame):
    axis = motion.axis if frame.dim == 2 else tuple(frame.directions(motion.axis))
    centre = tuple(frame.points(np.array([motion.centre]))[0])
    return pdvol.Rotation(frame.hand * motion.speed / frame.time, centre, axis, frame.time * motion.stop)


@put.register
def _(motion: pdvol.Path, frame):
    points = [vector(point, frame, frame.length) for point in motion.points]
    return pdvol.Path(timed(motion.times, frame), points, motion.smooth)


@put.register
def _(motion: pdvol.Sequential, frame):
    return pdvol.Sequential(tuple(moving(part, frame) for part in motion.motions))


@put.register
def _(motion: pdvol.PointCache, frame):
    source = np.array([frame.points(motion.placement(np.asarray(points))) for points in motion.source])
    return replace(
        motion,
        source=source,
        faces=None if motion.faces is None else frame.corners(np.asarray(motion.faces)),
        times=timed(motion.times, frame),
        begin=frame.time * motion.begin,
        placement=pdvol.Placement(),
    )


def moving(motion, frame: Frame):
    """A motion of pdvol, or a user's own."""
    if type(motion) in put.registry:
        return put(motion, frame)
    return lambda X, t: frame.points(motion(frame.back(X), t / frame.time))


# ---- surroundings


@put.register
def _(plane: pdvol.Plane, frame):
    point = tuple(frame.points(np.array([plane.point]))[0])
    return replace(plane, point=point, normal=tuple(frame.directions(plane.normal)), motion=moving(plane.motion, frame))


@put.register
def _(rigid: pdvol.Rigid, frame):
    shape = placed(rigid.shape, rigid.placement, frame)
    return replace(rigid, shape=shape, placement=pdvol.Placement(), motion=moving(rigid.motion, frame))


@put.register
def _(obstacle: pdvol.Deforming, frame):
    shape = None if obstacle.shape is None else placed(obstacle.shape, obstacle.placement, frame)
    return replace(obstacle, shape=shape, placement=pdvol.Placement(), motion=put(obstacle.motion, frame))


@put.register
def _(support: pdvol.Support, frame):
    where, motion = mask(support.where, frame), moving(support.motion, frame)
    return replace(support, where=where, motion=motion, release=frame.time * support.release)


# ---- loads, muscles, springs, contact


@put.register
def _(load: pdvol.Gravity, frame):
    return pdvol.Gravity(vector(load.acceleration, frame, frame.unit(0, 1, -2)))


@put.register
def _(load: pdvol.Force, frame):
    return replace(load, force=vector(load.force, frame, frame.unit(1, 1, -2)), where=mask(load.where, frame))


@put.register
def _(load: pdvol.PointForce, frame):
    at = tuple(frame.points(np.array([load.at]))[0])
    return replace(load, force=vector(load.force, frame, frame.unit(1, 1, -2)), at=at)


@put.register
def _(load: pdvol.Impulse, frame):
    velocity = vector(load.velocity, frame, frame.unit(0, 1, -1))
    return replace(load, velocity=velocity, time=frame.time * load.time, where=mask(load.where, frame))


@put.register
def _(load: pdvol.Flow, frame):
    return replace(
        load, velocity=vector(load.velocity, frame, frame.unit(0, 1, -1)), density=frame.density * load.density
    )


@put.register
def _(load: pdvol.Pressure, frame):
    return replace(load, pressure=number(load.pressure, frame, frame.stress))


@put.register
def _(muscle: pdvol.Muscle, frame):
    return replace(
        muscle,
        fibre=tuple(frame.directions(muscle.fibre)),
        strength=frame.stress * muscle.strength,
        activation=number(muscle.activation, frame, 1.0),
        where=mask(muscle.where, frame),
    )


@put.register
def _(springs: pdvol.Attachment, frame):
    rest, most = springs.rest_length, springs.breaking
    return replace(
        springs,
        where=mask(springs.where, frame),
        to=mask(springs.to, frame),
        stiffness=frame.unit(1, 0, -2) * springs.stiffness,
        rest_length=None if rest is None else frame.length * rest,
        breaking=None if most is None else frame.unit(1, 1, -2) * most,
    )


@put.register
def _(pull: pdvol.Pull, frame):
    where, *points = map(tuple, frame.points(np.array([pull.where, *pull.points])))
    stiffness, times = frame.unit(1, 0, -2) * pull.stiffness, timed(pull.times, frame)
    return pdvol.Pull(pull.body, where, times, points, stiffness, frame.length * pull.radius)


@put.register
def _(barrier: pdvol.Barrier, frame):
    return replace(barrier, dhat=length(barrier.dhat, frame))


@put.register
def _(friction: pdvol.Friction, frame):
    return replace(friction, eps_v=speed(friction.eps_v, frame))


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
