"""Where a shape is put in the scene."""

from dataclasses import dataclass

import numpy as np

from pdvol.scene.checks import finite, optional, positive, require, vector
from pdvol.scene.element import Element
from pdvol.scene.motions import rotation_matrix
from pdvol.scene.values import Vector


@dataclass(frozen=True, repr=False)
class Placement(Element):
    """Scale, then rotate by `angle` [rad] about `axis` through the origin, then translate [m].

    Attributes
    ----------
    translate : (d,) [m]; nowhere when empty
    angle : [rad]
    axis : (3,) direction, of any length but zero; in 2D (0, 0, -1) turns clockwise
    scale : a factor, positive
    """

    translate: Vector = ()
    angle: float = 0.0
    axis: Vector = (0.0, 0.0, 1.0)
    scale: float = 1.0

    checks = {"translate": optional(vector, ()), "angle": finite, "axis": optional(vector, ()), "scale": positive}

    def __call__(self, points: np.ndarray) -> np.ndarray:
        dim = points.shape[1]
        moved = self.scale * points @ rotation_matrix(self.angle, self.axis, dim).T
        if not (size := len(self.translate)):
            return moved
        require(size == dim, f"Placement.translate has {size} components in a {dim}D scene")
        return moved + np.asarray(self.translate, dtype=float)
