"""What acts on the bodies from outside: rigid obstacles and supports."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pdvol.meshes import Outline, Surface
from pdvol.scene.bodies import Placement
from pdvol.scene.checks import require, vector
from pdvol.scene.motions import Motion, Still


@dataclass(frozen=True)
class Plane:
    """A rigid half-space: the side that `normal` points to is free."""

    point: tuple[float, ...]
    normal: tuple[float, ...]
    motion: Motion = Still()
    name: str = "plane"

    def __post_init__(self):
        vector(f"plane {self.name!r}: point", self.point)
        vector(f"plane {self.name!r}: normal", self.normal)
        require(len(self.point) == len(self.normal), f"plane {self.name!r}: point and normal differ in length")
        require(np.linalg.norm(self.normal) > 0, f"plane {self.name!r}: the normal is zero")


@dataclass(frozen=True)
class Rigid:
    """A rigid obstacle: a surface (3D), a closed outline or an open polyline (2D); the path of a surface file will do."""

    shape: str | Path | Outline | Surface
    placement: Placement = Placement()
    motion: Motion = Still()
    name: str = "obstacle"
    closed: bool = True


@dataclass(frozen=True)
class Support:
    """Vertices whose positions are prescribed.

    Attributes
    ----------
    where : function of rest positions (n, d) giving a mask (n,)
    body : name of the body it applies to; all bodies when empty
    motion : callable (X, t) -> x; Still() fixes them
    """

    where: Callable[[np.ndarray], np.ndarray]
    body: str = ""
    motion: Motion = Still()
