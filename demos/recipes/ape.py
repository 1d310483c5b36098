"""A gorilla, sitting: one fist on the ground, the other arm raised. The shape of demos/ape.py."""

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from pdvol.meshes import Surface
from pdvol.meshes.implicit import capsule, ellipsoid

from .field import Field


@lru_cache(maxsize=4)  # seconds to make
def ape(height: float = 1.0, vertices: int = 5000) -> Surface:
    """A gorilla `height` [m] tall to the top of its head, y up, facing +z; its seat, its soles and its right fist (-x)
    rest flat on y = 0. `vertices` of the surface, about.
    """
    figure = Field(0.014, (-0.70, 0.85), (-0.06, 1.16), (-0.46, 0.72))
    p, q = figure.p, figure.q
    parts = [
        (ellipsoid(p, (0.0, 0.20, -0.02), (0.27, 0.24, 0.25)), 0.12),  # belly and seat
        (ellipsoid(p, (0.0, 0.50, -0.03), (0.26, 0.27, 0.20)), 0.12),  # chest
        (ellipsoid(q, (0.11, 0.54, 0.11), (0.13, 0.10, 0.09)), 0.06),  # breast
        (capsule(q, (0.0, 0.66, -0.07), (0.25, 0.62, -0.05), 0.115), 0.10),  # shoulders
        (ellipsoid(p, (0.0, 0.83, 0.05), (0.135, 0.145, 0.150)), 0.06),  # head
        (ellipsoid(p, (0.0, 0.945, -0.01), (0.060, 0.075, 0.110)), 0.06),  # crest
        (capsule(q, (0.0, 0.897, 0.160), (0.075, 0.888, 0.145), 0.034), 0.02),  # brow
        (ellipsoid(p, (0.0, 0.755, 0.170), (0.105, 0.080, 0.090)), 0.03),  # muzzle
        (ellipsoid(q, (0.030, 0.788, 0.245), (0.030, 0.022, 0.028)), 0.015),  # nose
        (ellipsoid(q, (0.052, 0.846, 0.188), (0.027, 0.025, 0.027)), 0.004),  # eyes
        (ellipsoid(q, (0.140, 0.835, 0.03), (0.028, 0.045, 0.034)), 0.015),  # ears
        (capsule(q, (0.15, 0.13, 0.06), (0.27, 0.19, 0.36), 0.115), 0.06),  # thighs
        (capsule(q, (0.27, 0.19, 0.36), (0.25, 0.06, 0.46), 0.090), 0.05),  # shins
        (ellipsoid(q, (0.25, 0.045, 0.54), (0.085, 0.065, 0.130)), 0.05),  # feet
        *_arm(p, (-0.29, 0.61, -0.03), (-0.48, 0.36, 0.02), (-0.46, 0.08, 0.16), (-0.46, 0.055, 0.19)),
        *_arm(p, (0.29, 0.61, -0.03), (0.55, 0.55, 0.10), (0.60, 0.86, 0.20), (0.605, 0.92, 0.22)),
    ]
    figure.join(parts)
    figure.cut(capsule(q, (0.0, 0.728, 0.264), (0.070, 0.738, 0.236), 0.011), 0.015)  # mouth
    figure.cut(ellipsoid(q, (0.026, 0.790, 0.274), (0.012, 0.010, 0.016)), 0.008)  # nostrils
    figure.flatten(0.0, 0.02)  # where it sits and stands
    points, triangles = figure.contour(vertices)
    points = points - [0.0, points[:, 1].min(), 0.0]
    head = points[np.abs(points[:, 0]) < 0.2, 1].max()
    return Surface(points * (height / head), triangles)


def _arm(
    p: np.ndarray, shoulder: ArrayLike, elbow: ArrayLike, wrist: ArrayLike, fist: ArrayLike
) -> list[tuple[np.ndarray, float]]:
    """The parts of one arm, with their fillets."""
    return [
        (capsule(p, shoulder, elbow, 0.098), 0.08),
        (capsule(p, elbow, wrist, 0.080), 0.05),
        (ellipsoid(p, fist, (0.105, 0.095, 0.105)), 0.04),
    ]
