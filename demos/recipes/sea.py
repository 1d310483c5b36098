"""Life on a sea floor: a leaf sheep (a sea slug with leaves on its back), a mushroom-like plant and a stone."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike

from pdvol.meshes import Surface
from pdvol.meshes.implicit import capsule, cone, contoured, ellipsoid, join

ROWS = ((12.0, 5), (44.0, 5), (74.0, 4))  # degrees from upright, leaves: rows of leaves on each side of the back
SPINE = np.array([[0.0, 0.03, -0.58], [0.0, 0.06, -0.40], [0.0, 0.085, -0.18], [0.0, 0.095, 0.05], [0.0, 0.09, 0.28]])
WIDTHS = (0.022, 0.060, 0.095, 0.105, 0.090)  # radii of the body at the points of its spine, tail first


@lru_cache(maxsize=4)  # seconds to make
def leaf_sheep(length: float = 0.5, vertices: int = 12000) -> Surface:
    """A sea slug `length` [m] long, y up, its head along +z, its foot at y = 0, with 28 leaves (cerata) on its back.

    `vertices` of the surface, about.
    """
    h = 0.009  # grid cell of a figure about one unit long
    axes = [np.arange(a, b, h) for a, b in ((-0.44, 0.44), (-0.04, 0.56), (-0.66, 0.64))]
    field = _Field(axes)
    for part in _slug():
        field.join(part)
    field.flatten(0.0, 0.03)
    return field.surface(h, vertices, 2, length)


@lru_cache(maxsize=4)
def sea_mushroom(height: float = 0.6, vertices: int = 3000) -> Surface:
    """A plant with a stem and three caps like shelves, the widest on top: `height` [m] tall, y up, on y = 0.

    Parameters
    ----------
    height : [m]
    vertices : of the surface, about
    """
    h = 0.014
    axes = [np.arange(a, b, h) for a, b in ((-0.80, 0.80), (-0.05, 1.10), (-0.52, 0.52))]
    field = _Field(axes)
    field.join(Part(partial(capsule, start=(0.0, 0.05, -0.06), end=(0.0, 0.90, -0.02), radius=0.085), 0.05))
    field.join(Part(partial(ellipsoid, centre=(0.0, 0.0, -0.06), radii=(0.22, 0.10, 0.20)), 0.10))
    for centre, radii, foot in (
        ((-0.36, 0.98, 0.02), (0.36, 0.055, 0.32), (-0.14, 0.90, 0.0)),
        ((0.40, 0.86, 0.06), (0.34, 0.055, 0.32), (0.16, 0.78, 0.02)),
        ((0.02, 0.50, 0.24), (0.24, 0.050, 0.22), (0.0, 0.44, 0.06)),
    ):
        field.join(Part(partial(ellipsoid, centre=centre, radii=radii), 0.05))
        under = np.array(centre) - [0.0, 0.03, 0.0]
        field.join(Part(partial(capsule, start=foot, end=under, radius=0.055), 0.06))
    field.flatten(0.0, 0.02)
    return field.surface(h, vertices, 1, height)


@lru_cache(maxsize=4)
def stone(width: float = 0.4, vertices: int = 1500, seed: int = 0) -> Surface:
    """A rounded stone `width` [m] wide along x, y up, flat at y = 0; `seed` chooses its bumps.

    Parameters
    ----------
    width : [m]
    vertices : of the surface, about
    seed : of its bumps
    """
    h = 0.02
    axes = [np.arange(a, b, h) for a, b in ((-0.62, 0.62), (-0.06, 0.62), (-0.62, 0.62))]
    field, random = _Field(axes), np.random.default_rng(seed)
    field.join(Part(partial(ellipsoid, centre=(0.0, 0.12, 0.0), radii=(0.46, 0.30, 0.40)), 0.1))
    for _ in range(7):
        way = random.normal(size=3) * [1.0, 0.5, 1.0]
        centre = way / np.linalg.norm(way) * [0.30, 0.20, 0.26] + [0.0, 0.12, 0.0]
        radius = random.uniform(0.10, 0.18)
        field.join(Part(partial(ellipsoid, centre=centre, radii=(radius, radius, radius)), 0.12))
    field.flatten(0.0, 0.04)
    return field.surface(h, vertices, 0, width)


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a figure.

    Attributes
    ----------
    distance : function of points (..., 3) that gives their signed distances (...)
    blend : size of the fillet between it and the rest
    low, high : (3,) corners of the box in which it is evaluated; everywhere by default
    """

    distance: Callable[[np.ndarray], np.ndarray]
    blend: float
    low: ArrayLike = (-9.0, -9.0, -9.0)
    high: ArrayLike = (9.0, 9.0, 9.0)


class _Field:
    """A signed distance on a grid, joined from parts."""

    def __init__(self, axes: list[np.ndarray]):
        self.axes = axes
        self.points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self.values = np.full(self.points.shape[:3], 1.0)

    def join(self, part: Part) -> None:
        """Join a part with what is there, within its box."""
        box = tuple(
            slice(int(np.searchsorted(axis, a)), int(np.searchsorted(axis, b)))
            for axis, a, b in zip(self.axes, np.asarray(part.low), np.asarray(part.high), strict=True)
        )
        self.values[box] = join(self.values[box], part.distance(self.points[box]), part.blend)

    def flatten(self, height: float, blend: float) -> None:
        """Take away what is below a height, with a rounded edge."""
        self.values = -join(-self.values, self.points[..., 1] - height, blend)

    def surface(self, h: float, vertices: int, axis: int, size: float) -> Surface:
        """The contour, scaled so that it is `size` long along an axis, its lowest point at y = 0."""
        points, triangles = contoured(self.values, self.axes, h, vertices)
        points = points - [0.0, points[:, 1].min(), 0.0]
        scale = size / np.ptp(points[:, axis])
        return Surface(points * scale, np.ascontiguousarray(triangles, dtype=np.int32))


def _slug() -> list[Part]:
    """The parts of a leaf sheep one unit long."""
    parts = [
        Part(partial(cone, start=a, end=b, first=first, last=last), 0.02)
        for a, b, first, last in zip(SPINE[:-1], SPINE[1:], WIDTHS[:-1], WIDTHS[1:], strict=True)
    ]
    parts += [
        Part(partial(ellipsoid, centre=(0.0, 0.105, 0.40), radii=(0.125, 0.110, 0.120)), 0.06),  # head
        Part(partial(ellipsoid, centre=(0.0, 0.025, 0.0), radii=(0.150, 0.030, 0.46)), 0.04),  # foot
    ]
    for side in (-1.0, 1.0):
        mirror = np.array([side, 1.0, 1.0])
        for a, b, first, last, blend in (
            ((0.060, 0.185, 0.40), (0.135, 0.375, 0.455), 0.034, 0.022, 0.03),  # rhinophores: the sheep's ears
            ((0.085, 0.075, 0.48), (0.165, 0.055, 0.555), 0.036, 0.022, 0.03),  # lip
        ):
            start, end = a * mirror, b * mirror
            low, high = np.minimum(start, end) - 0.16, np.maximum(start, end) + 0.16
            parts.append(Part(partial(cone, start=start, end=end, first=first, last=last), blend, low, high))
        eye = np.array([side * 0.052, 0.160, 0.492])
        parts.append(Part(partial(ellipsoid, centre=eye, radii=(0.026, 0.030, 0.022)), 0.006, eye - 0.1, eye + 0.1))
        parts += [_leaf(side, degrees, (k + 0.5) / count) for degrees, count in ROWS for k in range(count)]
    return parts


def _leaf(side: float, degrees: float, along: float) -> Part:
    """A leaf on the back: `along` from the tail, 0, to the neck, 1."""
    angle = np.radians(degrees)
    z = -0.40 + 0.62 * along
    radius = np.interp(z, SPINE[:, 2], WIDTHS)
    height = np.interp(z, SPINE[:, 2], SPINE[:, 1])
    out = np.array([side * np.sin(angle), np.cos(angle), 0.0])
    way = out + [0.0, 0.0, -0.45 + 0.25 * along]
    way /= np.linalg.norm(way)
    length = (0.25 - 0.05 * abs(2.0 * along - 0.9)) * (1.0 - 0.10 * degrees / 70.0)
    base = np.array([0.0, height, z]) + 0.75 * radius * out
    wide = np.array([0.0, 0.0, 1.0]) - way[2] * way
    wide /= np.linalg.norm(wide)
    frame = np.array([wide, np.cross(way, wide), way])
    middle = base + 0.52 * length * way

    def part(p: np.ndarray) -> np.ndarray:
        q = (p - middle) @ frame.T
        q[..., 0] *= 1.0 + 0.9 * np.clip(q[..., 2] / length + 0.1, 0.0, 0.6)  # narrower towards its tip
        return ellipsoid(q, (0.0, 0.0, 0.0), (0.056, 0.030, 0.56 * length))

    reach = 0.62 * length + 0.06
    return Part(part, 0.022, middle - reach, middle + reach)
