"""Flat slices in the shape of animals, thin as noodles."""

from functools import lru_cache

import numpy as np

from pdvol.meshes import Outline, Solid
from pdvol.meshes.grids import layered
from pdvol.meshes.implicit import capsule, ellipsoid
from pdvol.meshing.triangulate import triangulate

from .field import Field


def bunny_outline(height: float = 0.3, points: int = 120) -> Outline:
    """A sitting bunny in profile, looking along +x, `height` [m] tall to the tips of its ears, its feet at y = 0.

    `points` of the outline.
    """
    figure = Field(0.004, (-0.52, 0.52), (-0.06, 1.10))
    p = figure.p
    parts = [
        (ellipsoid(p, (-0.05, 0.27), (0.31, 0.25)), 0.05),  # belly
        (ellipsoid(p, (-0.16, 0.20), (0.21, 0.19)), 0.05),  # haunch
        (ellipsoid(p, (0.16, 0.36), (0.15, 0.17)), 0.08),  # chest
        (ellipsoid(p, (0.24, 0.57), (0.165, 0.135)), 0.06),  # head
        (ellipsoid(p, (0.36, 0.53), (0.065, 0.055)), 0.04),  # muzzle
        (capsule(p, (0.20, 0.68), (0.05, 0.98), 0.052), 0.03),  # ears
        (capsule(p, (0.25, 0.68), (0.27, 1.00), 0.050), 0.03),
        (capsule(p, (0.22, 0.30), (0.30, 0.055), 0.055), 0.04),  # foreleg
        (capsule(p, (-0.20, 0.055), (0.08, 0.055), 0.058), 0.04),  # hind foot
        (ellipsoid(p, (-0.395, 0.22), (0.085, 0.085)), 0.03),  # tail
    ]
    return figure.join(parts).outline(points, height)


@lru_cache(maxsize=8)  # bodies of one shape share it
def bunny_slice(height: float, thickness: float, vertices: int, layers: int) -> Solid:
    """A slice [m] in the shape of `bunny_outline`, lying flat: y is its thickness, its middle the origin. `vertices` of
    one face, about; `layers` of cells through the thickness.
    """
    outline = bunny_outline(height, 160).points
    flat = triangulate([outline - (outline.max(axis=0) + outline.min(axis=0)) / 2.0], vertices, "slice")
    x, z = flat.points.T
    heights = thickness * np.linspace(-0.5, 0.5, layers + 1)
    return layered([np.column_stack([x, np.full(len(x), y), -z]) for y in heights], flat.cells)
