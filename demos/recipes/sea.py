"""Life on a sea floor: a leaf sheep (a sea slug with leaves on its back), a mushroom-like plant and a stone."""

from functools import lru_cache, partial

import numpy as np

from pdvol.meshes import Surface
from pdvol.meshes.implicit import capsule, cone, ellipsoid

from .field import Field

ROWS = ((12.0, 5), (44.0, 5), (74.0, 4))  # degrees from upright, leaves: rows of leaves on each side of the back
SPINE = np.array([[0.0, 0.03, -0.58], [0.0, 0.06, -0.40], [0.0, 0.085, -0.18], [0.0, 0.095, 0.05], [0.0, 0.09, 0.28]])
WIDTHS = (0.022, 0.060, 0.095, 0.105, 0.090)  # radii of the body at the points of its spine, tail first


@lru_cache(maxsize=4)  # seconds to make
def leaf_sheep(length: float = 0.5, vertices: int = 12000) -> Surface:
    """A sea slug `length` [m] long, y up, its head along +z, its foot at y = 0, with 28 leaves (cerata) on its back.

    `vertices` of the surface, about.
    """
    figure = Field(0.009, (-0.44, 0.44), (-0.04, 0.56), (-0.66, 0.64))
    _slug(figure)
    figure.flatten(0.0, 0.03)
    return figure.surface(vertices, 2, length)


@lru_cache(maxsize=4)
def sea_mushroom(height: float = 0.6, vertices: int = 3000) -> Surface:
    """A plant with a stem and three caps like shelves, the widest on top: `height` [m] tall, y up, on y = 0. `vertices`
    of the surface, about.
    """
    figure = Field(0.014, (-0.80, 0.80), (-0.05, 1.10), (-0.52, 0.52))
    p = figure.p
    parts = [
        (capsule(p, (0.0, 0.05, -0.06), (0.0, 0.90, -0.02), 0.085), 0.05),
        (ellipsoid(p, (0.0, 0.0, -0.06), (0.22, 0.10, 0.20)), 0.10),
    ]
    for centre, radii, foot in (
        ((-0.36, 0.98, 0.02), (0.36, 0.055, 0.32), (-0.14, 0.90, 0.0)),
        ((0.40, 0.86, 0.06), (0.34, 0.055, 0.32), (0.16, 0.78, 0.02)),
        ((0.02, 0.50, 0.24), (0.24, 0.050, 0.22), (0.0, 0.44, 0.06)),
    ):
        under = np.array(centre) - [0.0, 0.03, 0.0]
        parts += [(ellipsoid(p, centre, radii), 0.05), (capsule(p, foot, under, 0.055), 0.06)]
    figure.join(parts).flatten(0.0, 0.02)
    return figure.surface(vertices, 1, height)


@lru_cache(maxsize=4)
def stone(width: float = 0.4, vertices: int = 1500, seed: int = 0) -> Surface:
    """A rounded stone `width` [m] wide along x, y up, flat at y = 0; `seed` chooses its bumps. `vertices` of the
    surface, about.
    """
    figure = Field(0.02, (-0.62, 0.62), (-0.06, 0.62), (-0.62, 0.62))
    parts, random = [(ellipsoid(figure.p, (0.0, 0.12, 0.0), (0.46, 0.30, 0.40)), 0.1)], np.random.default_rng(seed)
    for _ in range(7):
        way = random.normal(size=3) * [1.0, 0.5, 1.0]
        centre = way / np.linalg.norm(way) * [0.30, 0.20, 0.26] + [0.0, 0.12, 0.0]
        radius = random.uniform(0.10, 0.18)
        parts.append((ellipsoid(figure.p, centre, (radius, radius, radius)), 0.12))
    figure.join(parts).flatten(0.0, 0.04)
    return figure.surface(vertices, 0, width)


def _slug(figure: Field) -> None:
    """A leaf sheep one unit long."""
    p, ends = figure.p, zip(SPINE[:-1], SPINE[1:], WIDTHS[:-1], WIDTHS[1:], strict=True)
    figure.join((cone(p, a, b, first, last), 0.02) for a, b, first, last in ends)
    head, foot = (0.0, 0.105, 0.40), (0.0, 0.025, 0.0)
    figure.join([(ellipsoid(p, head, (0.125, 0.110, 0.120)), 0.06), (ellipsoid(p, foot, (0.150, 0.030, 0.46)), 0.04)])
    for side in (-1.0, 1.0):
        mirror = np.array([side, 1.0, 1.0])
        for a, b, first, last, blend in (
            ((0.060, 0.185, 0.40), (0.135, 0.375, 0.455), 0.034, 0.022, 0.03),  # rhinophores: the sheep's ears
            ((0.085, 0.075, 0.48), (0.165, 0.055, 0.555), 0.036, 0.022, 0.03),  # lip
        ):
            start, end = a * mirror, b * mirror
            low, high = np.minimum(start, end) - 0.16, np.maximum(start, end) + 0.16
            figure.join_within(partial(cone, start=start, end=end, first=first, last=last), blend, low, high)
        eye = np.array([side * 0.052, 0.160, 0.492])
        figure.join_within(partial(ellipsoid, centre=eye, radii=(0.026, 0.030, 0.022)), 0.006, eye - 0.1, eye + 0.1)
        for degrees, count in ROWS:
            for k in range(count):
                _leaf(figure, side, degrees, (k + 0.5) / count)


def _leaf(figure: Field, side: float, degrees: float, along: float) -> None:
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
    figure.join_within(part, 0.022, middle - reach, middle + reach)
