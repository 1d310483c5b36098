"""Obstacles, rigid and deforming, and supports."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.meshes import Outline, Surface
from pdvol.scene.checks import anything, instance, mask, moment, positive, require, takes, vector
from pdvol.scene.element import NOT_SIMULATED, Element
from pdvol.scene.hand import Hand
from pdvol.scene.motions import Led, Motion, Still
from pdvol.scene.placement import Placement
from pdvol.scene.point_caches import PointCache
from pdvol.scene.values import Vector


def _moves(name: str, motion: Any) -> None:
    require(
        callable(motion) or isinstance(motion, PointCache),
        f"{name} = {motion!r} must be a motion, a callable (X, t) -> x or a PointCache",
    )
    takes(name, motion, "X", "t")


def _moves_rigidly(name: str, motion: Any) -> None:
    require(
        not isinstance(motion, PointCache),
        f"{name}: a PointCache moves each point by itself; use Deforming, or a Support",
    )
    _moves(name, motion)


@dataclass(frozen=True, repr=False)
class Plane(Element):
    """A rigid half-space: the side that `normal` points to is free.

    Attributes
    ----------
    point : (d,) [m], a point of its surface
    normal : (d,) of any length but zero
    motion : callable (X, t) -> x; Still() by default
    name : of this obstacle, for friction and messages
    """

    point: Vector
    normal: Vector
    motion: Motion = Still()
    name: str = "plane"

    whose = "plane {name!r}: "
    checks = {"point": vector, "normal": vector, "motion": _moves_rigidly}

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.point) == len(self.normal), f"plane {self.name!r}: point and normal differ in length")
        require(np.linalg.norm(self.normal) > 0, f"plane {self.name!r}: the normal is zero")


@dataclass(frozen=True, repr=False)
class Rigid(Element):
    """A rigid obstacle: a surface (3D), a closed outline or an open polyline (2D); the path of a surface file will do.

    Attributes
    ----------
    shape : path, `Outline` or `Surface`
    placement : of the shape in the scene
    motion : callable (X, t) -> x; Still() by default
    name : of this obstacle, for friction and messages
    closed : of an outline, whether its last point is joined to its first
    opacity : above 0 and at most 1: how pictures draw a surface; below 1 what is behind shows through
    movable : whether a hand may shift it from its motion
    """

    shape: str | Path | Outline | Surface
    placement: Placement = Placement()
    motion: Motion = Still()
    name: str = "obstacle"
    closed: bool = True
    opacity: float = 1.0
    movable: bool = field(default=False, metadata={NOT_SIMULATED: True})

    whose = "obstacle {name!r}: "
    files = ("shape",)
    checks = {"motion": _moves_rigidly, "closed": anything, "opacity": partial(positive, highest=1.0)}


@dataclass(frozen=True, repr=False)
class Deforming(Element):
    """An obstacle whose vertices follow an animation. Within a step they move on straight ways, and collision detection
    and friction see each of them.

    Attributes
    ----------
    motion : PointCache
    shape : as of `Rigid`, matched to the animation's first frame; where not given, the animated mesh itself
    placement : of the shape
    name, closed, opacity : as of `Rigid`
    """

    motion: PointCache
    shape: str | Path | Outline | Surface | None = None
    placement: Placement = Placement()
    name: str = "obstacle"
    closed: bool = True
    opacity: float = 1.0

    whose = Rigid.whose
    files = ("shape",)
    checks = {**Rigid.checks, "motion": instance(PointCache, "; a Rigid takes functions")}


Obstructing = Plane | Rigid | Deforming
"""What bodies cannot enter."""


@dataclass(frozen=True, repr=False)
class Support(Element):
    """Vertices whose positions are prescribed; of several supports of a vertex the last one decides.

    Attributes
    ----------
    where : function of rest positions (n, d) giving a mask (n,)
    body : name of the body it applies to; all bodies when empty
    motion : callable (X, t) -> x, X where they are at t = 0; Still() fixes them. A PointCache moves those on the body's
        surface alone
    release : time [s]; they are free in all steps that begin then or later
    movable : as of `Rigid`, not with a PointCache
    """

    where: Callable[[np.ndarray], np.ndarray]
    body: str = ""
    motion: Motion | PointCache = Still()
    release: float = np.inf
    movable: bool = field(default=False, metadata={NOT_SIMULATED: True})

    checks = {"where": mask, "motion": _moves, "release": moment}

    def __post_init__(self) -> None:
        super().__post_init__()
        require(
            not (self.movable and isinstance(self.motion, PointCache)), "a Support that is movable takes no PointCache"
        )

    def holds(self, time: float, dt: float) -> bool:
        """Whether a step of dt [s] from `time` [s] on still holds them, to a millionth of the step."""
        return time < self.release - 1e-6 * dt


def led(things: Sequence[Any], hand: Hand | None, dt: float) -> tuple[Any, ...]:
    """Obstacles or supports, of which a hand shifts the movable ones."""
    if hand is None:
        return tuple(things)

    def shifted(number: int, each: Any) -> Any:
        own, name = each.motion.own if isinstance(each.motion, Led) else each.motion, f"support {number}"
        return replace(each, motion=Led(own, getattr(each, "name", name), hand, dt))

    return tuple(shifted(i, each) if getattr(each, "movable", False) else each for i, each in enumerate(things))
