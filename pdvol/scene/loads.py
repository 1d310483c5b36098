"""Loads: accelerations, forces, impulses, flows and pressures, constant or changing with time.

Values that change are functions of time, evaluated at the end of each step: nothing is compiled again. What acts on a
part takes `where`, a function of rest positions (n, d), as placed, that gives a mask (n,), and `body`, a name;
everything where left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from pdvol.scene.checks import finite, mask, numbers, positive, require, vector
from pdvol.scene.element import Element
from pdvol.scene.values import Keyed, Vector, timed

TimedVector = Vector | Keyed | Callable[[float], Vector]
"""A vector, `Keyed` vectors, or a function of time [s] that gives one."""
Where = Callable[[np.ndarray], np.ndarray]


def everywhere(X: np.ndarray) -> np.ndarray:
    """All points."""
    return np.ones(len(X), dtype=bool)


def at_time(name: str, value: TimedVector, time: float, dim: int) -> np.ndarray:
    """(dim,) a vector at a time. Raises InputError, naming it, where it does not fit or is not finite."""
    if callable(value):
        return numbers(name, value, (time,), (dim,), f" at t = {time:g} s")
    require(len(value) == dim, f"{name} {tuple(value)} has {len(value)} components in a {dim}D scene")
    return np.array(value, dtype=float)


@dataclass(frozen=True, repr=False)
class Gravity(Element):
    """A uniform acceleration (d,) [m/s^2]: a vector, `Keyed` vectors, or a function of time [s] that gives one."""

    acceleration: TimedVector
    checks = {"acceleration": timed(vector)}


@dataclass(frozen=True, repr=False)
class Force(Element):
    """A total force [N] ([N] per metre of depth in 2D), or a function of time that gives one, distributed by mass over
    a region.

    The total is the same on every level, whatever its vertices.

    Attributes
    ----------
    force : (d,) [N], `Keyed` ones, or a function of time [s] that gives it
    where : function of rest positions (n, d) [m] giving a mask (n,); everywhere by default
    body : name of the body it acts on; all bodies when empty
    """

    force: TimedVector
    where: Where = everywhere
    body: str = ""
    checks = {"force": timed(vector), "where": mask}


@dataclass(frozen=True, repr=False)
class PointForce(Element):
    """A force [N], or a function of time that gives one, on the material at a rest position [m], as placed.

    It acts on the corners of the cell there by their barycentric coordinates; of the nearest cell where a coarse level
    ends short of it.

    Attributes
    ----------
    force : (d,) [N], `Keyed` ones, or a function of time [s] that gives it
    at : (d,) rest position [m], as placed
    body : name of the body it acts on; all bodies when empty
    """

    force: TimedVector
    at: Vector
    body: str = ""
    checks = {"force": timed(vector), "at": vector}


@dataclass(frozen=True, repr=False)
class Impulse(Element):
    """A sudden change of velocity [m/s] of a region: the momentum that takes is given to it within the step in which
    `time` [s] falls.

    Attributes
    ----------
    velocity : (d,) change of velocity [m/s]
    time : [s]
    where : function of rest positions (n, d) [m] giving a mask (n,); everywhere by default
    body : name of the body it acts on; all bodies when empty
    """

    velocity: Vector
    time: float = 0.0
    where: Where = everywhere
    body: str = ""
    checks = {"velocity": vector, "time": partial(finite, lowest=0.0), "where": mask}


@dataclass(frozen=True, repr=False)
class Flow(Element):
    """A current or a wind that drags on all surfaces: the force per area is density drag / 2 |u - v| (u - v), u the
    flow's velocity and v the surface's.

    Areas are those at rest, both sides of a body feel the flow, and bodies do not shelter each other.

    Attributes
    ----------
    velocity : [m/s]: a vector, `Keyed` vectors, or a function (x, t) of positions (n, d) and time that gives (n, d)
    density : of the medium [kg/m^d]
    drag : the coefficient, per area of surface
    body : name of the body it acts on; all bodies when empty
    """

    velocity: Vector | Keyed | Callable[[np.ndarray, float], np.ndarray]
    density: float = 1000.0
    drag: float = 1.0
    body: str = ""
    checks = {"velocity": timed(vector, "x", "t"), "density": positive, "drag": positive}

    def at(self, positions: np.ndarray, time: float) -> np.ndarray:
        """(n, d) its velocity at positions (n, d) [m] and a time [s]."""
        if not callable(self.velocity) or isinstance(self.velocity, Keyed):
            return np.broadcast_to(at_time("Flow.velocity", self.velocity, time, positions.shape[1]), positions.shape)
        return numbers("Flow.velocity", self.velocity, (positions, time), positions.shape, f" at t = {time:g} s")


@dataclass(frozen=True, repr=False)
class Pressure(Element):
    """A pressure in all cavities of a body or, where it has none, in the body itself: a follower load, which pushes its
    surface outward.

    Attributes
    ----------
    body : name
    pressure : above that outside [Pa]: a number, `Keyed` numbers, or a function of time that gives one
    """

    body: str
    pressure: float | Keyed | Callable[[float], float]
    checks = {"pressure": timed(finite)}

    def at(self, time: float) -> float:
        """[Pa] at a time [s]. Raises InputError where a function fails or gives no finite number."""
        if not callable(self.pressure):
            return float(self.pressure)
        return float(numbers("Pressure.pressure", self.pressure, (time,), (), f" at t = {time:g} s"))


Load = Gravity | Force | PointForce | Impulse | Flow | Pressure
