"""Obstacles, rigid and deforming, and supports."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.meshes import Outline, Surface
from pdvol.scene.checks import keep_plain, positive, require, takes, vector
from pdvol.scene.motions import Motion, Still, Vector
from pdvol.scene.placement import Placement
from pdvol.scene.point_caches import PointCache
from pdvol.scene.representation import one_line


@dataclass(frozen=True)
class Plane:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "point", "normal")
        vector(f"plane {self.name!r}: point", self.point)
        vector(f"plane {self.name!r}: normal", self.normal)
        require(len(self.point) == len(self.normal), f"plane {self.name!r}: point and normal differ in length")
        require(np.linalg.norm(self.normal) > 0, f"plane {self.name!r}: the normal is zero")
        _no_cache(f"plane {self.name!r}", self.motion)


@dataclass(frozen=True)
class Rigid:
    """A rigid obstacle: a surface (3D), a closed outline or an open polyline (2D); the path of a surface file will do.

    Attributes
    ----------
    shape : path, `Outline` or `Surface`
    placement : of the shape in the scene
    motion : callable (X, t) -> x; Still() by default
    name : of this obstacle, for friction and messages
    closed : of an outline, whether its last point is joined to its first
    opacity : above 0 and at most 1: how pictures draw a surface; below 1 what is behind shows through
    """

    shape: str | Path | Outline | Surface
    placement: Placement = Placement()
    motion: Motion = Still()
    name: str = "obstacle"
    closed: bool = True
    opacity: float = 1.0
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "closed", "opacity")
        positive(f"obstacle {self.name!r}: opacity", self.opacity)
        require(self.opacity <= 1.0, f"obstacle {self.name!r}: opacity = {self.opacity!r} must be at most 1")
        _no_cache(f"obstacle {self.name!r}", self.motion)


@dataclass(frozen=True)
class Deforming:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "closed", "opacity")
        require(
            isinstance(self.motion, PointCache),
            f"obstacle {self.name!r}: motion must be a PointCache, not {type(self.motion).__name__};"
            " a Rigid takes functions",
        )
        positive(f"obstacle {self.name!r}: opacity", self.opacity)
        require(self.opacity <= 1.0, f"obstacle {self.name!r}: opacity = {self.opacity!r} must be at most 1")


Obstructing = Plane | Rigid | Deforming
"""What bodies cannot enter."""


@dataclass(frozen=True)
class Support:
    """Vertices whose positions are prescribed.

    Attributes
    ----------
    where : function of rest positions (n, d) giving a mask (n,)
    body : name of the body it applies to; all bodies when empty
    motion : callable (X, t) -> x, X where they are at t = 0; Still() fixes them. A PointCache moves those on the body's
        surface alone
    release : time [s]; they are free in all steps that begin then or later
    """

    where: Callable[[np.ndarray], np.ndarray]
    body: str = ""
    motion: Motion | PointCache = Still()
    release: float = np.inf
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "release")
        require(
            callable(self.where),
            f"Support.where = {self.where!r} must be a function of rest positions (n, d) giving a mask (n,)",
        )
        require(
            callable(self.motion) or isinstance(self.motion, PointCache),
            f"Support.motion = {self.motion!r} must be a motion, a callable (X, t) -> x or a PointCache",
        )
        takes("Support.where", self.where, "X")
        takes("Support.motion", self.motion, "X", "t")
        number = isinstance(self.release, (int, float, np.number)) and not isinstance(self.release, bool)
        require(
            number and self.release >= 0.0,
            f"Support.release = {self.release!r} must be a time, not negative (inf: never)",
        )

    def holds(self, time: float, dt: float) -> bool:
        """Whether a step of dt [s] that begins at `time` [s] still holds them; times are compared to a millionth of the
        step.
        """
        return time < self.release - 1e-6 * dt


def _no_cache(whose: str, motion: Any) -> None:
    require(
        not isinstance(motion, PointCache),
        f"{whose}: a PointCache moves each point by itself; use Deforming, or a Support",
    )
    takes(f"{whose}: motion", motion, "X", "t")
