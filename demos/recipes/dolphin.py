"""A plain dolphin: something long, thick in the middle and thin at its fins."""

import numpy as np

from pdvol.meshes import Surface
from pdvol.meshes.implicit import capsule, ellipsoid

from .field import Field


def dolphin(length: float = 1.0, vertices: int = 4000) -> Surface:
    """A dolphin `length` [m] long, its nose towards -y, its back towards +z, about the y axis; `vertices` of the
    surface, about.
    """
    h = 0.011
    figure = Field(h, (-0.28, 0.28 + h), (-0.56, 0.60 + h), (-0.22, 0.30 + h))
    p, q = figure.p, figure.q
    parts = [
        (ellipsoid(p, (0.0, -0.08, 0.0), (0.12, 0.36, 0.125)), 0.06),  # body
        (capsule(p, (0.0, -0.36, -0.02), (0.0, -0.50, -0.03), 0.032), 0.06),  # beak
        (capsule(p, (0.0, 0.15, 0.01), (0.0, 0.46, 0.02), 0.042), 0.10),  # stem of the tail
        (ellipsoid(q, (0.10, 0.51, 0.02), (0.12, 0.055, 0.030)), 0.04),  # flukes
        (ellipsoid(p, (0.0, 0.02, 0.15), (0.032, 0.075, 0.085)), 0.04),  # fin of the back
        (ellipsoid(q, (0.15, -0.16, -0.06), (0.085, 0.055, 0.030)), 0.04),  # flippers
    ]
    points, triangles = figure.join(parts).contour(vertices)
    points = points - [0.0, (points[:, 1].min() + points[:, 1].max()) / 2.0, 0.0]
    return Surface(points * (length / np.ptp(points[:, 1])), triangles)
