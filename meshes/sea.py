"""Life on a sea floor: a leaf sheep (a sea slug with leaves on its back), a mushroom-like plant and a stone."""

from functools import lru_cache

import numpy as np

from .geometry import Surface
from .implicit import capsule, cone, contoured, ellipsoid, join

ROWS = ((12.0, 5), (44.0, 5), (74.0, 4))  # degrees from upright, leaves: rows of leaves on each side of the back


@lru_cache(maxsize=4)  # seconds to make
def leaf_sheep(length: float = 0.5, vertices: int = 12000) -> Surface:
    """A sea slug `length` [m] long, y up, its head along +z, its foot at y = 0, with 28 leaves (cerata) on its back.

    `vertices` of the surface, about.
    """
    h = 0.009  # grid cell of a figure about one unit long
    axes = [np.arange(a, b, h) for a, b in ((-0.44, 0.44), (-0.04, 0.56), (-0.66, 0.64))]
    field = _Field(axes)
    for part, blend, low, high in _slug():
        field.join(part, blend, low, high)
    field.flatten(0.0, 0.03)
    return field.surface(h, vertices, 2, length)


@lru_cache(maxsize=4)
def sea_mushroom(height: float = 0.6, vertices: int = 3000) -> Surface:
    """A plant with a stem and three caps like shelves, the widest on top: `height` [m] tall, y up, on y = 0."""
    h = 0.014
    axes = [np.arange(a, b, h) for a, b in ((-0.80, 0.80), (-0.05, 1.10), (-0.52, 0.52))]
    field = _Field(axes)
    everywhere = np.array([-9.0, -9.0, -9.0]), np.array([9.0, 9.0, 9.0])
    field.join(lambda p: capsule(p, (0.0, 0.05, -0.06), (0.0, 0.90, -0.02), 0.085), 0.05, *everywhere)
    field.join(lambda p: ellipsoid(p, (0.0, 0.0, -0.06), (0.22, 0.10, 0.20)), 0.10, *everywhere)
    for centre, radii, foot in (
        ((-0.36, 0.98, 0.02), (0.36, 0.055, 0.32), (-0.14, 0.90, 0.0)),
        ((0.40, 0.86, 0.06), (0.34, 0.055, 0.32), (0.16, 0.78, 0.02)),
        ((0.02, 0.50, 0.24), (0.24, 0.050, 0.22), (0.0, 0.44, 0.06)),
    ):
        field.join(lambda p, c=centre, r=radii: ellipsoid(p, c, r), 0.05, *everywhere)
        field.join(lambda p, a=foot, b=centre: capsule(p, a, np.array(b) - [0.0, 0.03, 0.0], 0.055), 0.06, *everywhere)
    field.flatten(0.0, 0.02)
    return field.surface(h, vertices, 1, height)


@lru_cache(maxsize=4)
def stone(width: float = 0.4, vertices: int = 1500, seed: int = 0) -> Surface:
    """A rounded stone `width` [m] wide along x, y up, flat at y = 0; `seed` chooses its bumps."""
    h = 0.02
    axes = [np.arange(a, b, h) for a, b in ((-0.62, 0.62), (-0.06, 0.62), (-0.62, 0.62))]
    field, random = _Field(axes), np.random.default_rng(seed)
    everywhere = np.array([-9.0, -9.0, -9.0]), np.array([9.0, 9.0, 9.0])
    field.join(lambda p: ellipsoid(p, (0.0, 0.12, 0.0), (0.46, 0.30, 0.40)), 0.1, *everywhere)
    for _ in range(7):
        way = random.normal(size=3) * [1.0, 0.5, 1.0]
        centre = way / np.linalg.norm(way) * [0.30, 0.20, 0.26] + [0.0, 0.12, 0.0]
        radius = random.uniform(0.10, 0.18)
        field.join(lambda p, c=centre, r=radius: ellipsoid(p, c, (r, r, r)), 0.12, *everywhere)
    field.flatten(0.0, 0.04)
    return field.surface(h, vertices, 0, width)


class _Field:
    """A signed distance on a grid, joined from parts that are evaluated within their boxes alone."""

    def __init__(self, axes: list[np.ndarray]):
        self.axes = axes
        self.points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        self.values = np.full(self.points.shape[:3], 1.0)

    def join(self, part, blend: float, low: np.ndarray, high: np.ndarray) -> None:
        """Join a function of points with what is there, within the box from `low` to `high`."""
        box = tuple(
            slice(int(np.searchsorted(axis, a)), int(np.searchsorted(axis, b)))
            for axis, a, b in zip(self.axes, low, high, strict=True)
        )
        self.values[box] = join(self.values[box], part(self.points[box]), blend)

    def flatten(self, height: float, blend: float) -> None:
        """Take away what is below a height, with a rounded edge."""
        self.values = -join(-self.values, self.points[..., 1] - height, blend)

    def surface(self, h: float, vertices: int, axis: int, size: float) -> Surface:
        """The contour, scaled so that it is `size` long along an axis, its lowest point at y = 0."""
        points, triangles = contoured(self.values, self.axes, h, vertices)
        points = points - [0.0, points[:, 1].min(), 0.0]
        scale = size / np.ptp(points[:, axis])
        return Surface(points * scale, np.ascontiguousarray(triangles, dtype=np.int32))


def _slug() -> list:
    """Parts of a leaf sheep one unit long: functions of points, the blend with the rest, and the corners of a box."""
    everywhere = np.array([-9.0, -9.0, -9.0]), np.array([9.0, 9.0, 9.0])
    spine = np.array(
        [[0.0, 0.03, -0.58], [0.0, 0.06, -0.40], [0.0, 0.085, -0.18], [0.0, 0.095, 0.05], [0.0, 0.09, 0.28]]
    )
    widths = (0.022, 0.060, 0.095, 0.105, 0.090)
    parts = [
        (lambda p, a=a, b=b, r=r, s=s: cone(p, a, b, r, s), 0.02, *everywhere)
        for a, b, r, s in zip(spine[:-1], spine[1:], widths[:-1], widths[1:], strict=True)
    ]
    parts += [
        (lambda p: ellipsoid(p, (0.0, 0.105, 0.40), (0.125, 0.110, 0.120)), 0.06, *everywhere),  # head
        (lambda p: ellipsoid(p, (0.0, 0.025, 0.0), (0.150, 0.030, 0.46)), 0.04, *everywhere),  # foot
    ]
    for side in (-1.0, 1.0):
        for a, b, r, s, blend in (
            ((0.060, 0.185, 0.40), (0.135, 0.375, 0.455), 0.034, 0.022, 0.03),  # rhinophores: the sheep's ears
            ((0.085, 0.075, 0.48), (0.165, 0.055, 0.555), 0.036, 0.022, 0.03),  # lip
        ):
            mirror = np.array([side, 1.0, 1.0])
            low, high = np.minimum(a * mirror, b * mirror) - 0.16, np.maximum(a * mirror, b * mirror) + 0.16
            parts.append((lambda p, a=a * mirror, b=b * mirror, r=r, s=s: cone(p, a, b, r, s), blend, low, high))
        eye = np.array([side * 0.052, 0.160, 0.492])
        parts.append((lambda p, c=eye: ellipsoid(p, c, (0.026, 0.030, 0.022)), 0.006, eye - 0.1, eye + 0.1))
        for degrees, count in ROWS:
            for k in range(count):
                parts.append(_leaf(side, degrees, (k + 0.5) / count))
    return parts


def _leaf(side: float, degrees: float, along: float) -> tuple:
    """A leaf on the back: `along` from the tail, 0, to the neck, 1."""
    angle = np.radians(degrees)
    z = -0.40 + 0.62 * along
    radius = np.interp(z, [-0.58, -0.40, -0.18, 0.05, 0.28], [0.022, 0.060, 0.095, 0.105, 0.090])
    height = np.interp(z, [-0.58, -0.40, -0.18, 0.05, 0.28], [0.03, 0.06, 0.085, 0.095, 0.09])
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
    return part, 0.022, middle - reach, middle + reach
