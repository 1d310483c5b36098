"""Surfaces of revolution."""

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Surface


def turned(profile: ArrayLike, segments: int = 24) -> Surface:
    """A closed profile (n, 2) of radii and heights [m], not negative, turned about the y axis in `segments` steps.

    The profile runs anticlockwise, without repeating its first point; it may begin and end on the axis (radius 0),
    which closes the surface there, or keep away from it, which makes a ring.
    """
    curve = np.asarray(profile, dtype=float)
    angle = 2.0 * np.pi * np.arange(segments) / segments
    points: list[tuple[float, float, float]] = []
    rows = []
    for radius, height in curve:
        count, first = (segments, angle) if radius > 0.0 else (1, angle[:1])
        rows.append(len(points) + (np.arange(segments) if count > 1 else np.zeros(segments, dtype=int)))
        points += [(radius * np.cos(a), height, radius * np.sin(a)) for a in first]
    triangles = []
    for k in range(len(curve)):
        low, high = rows[k], rows[(k + 1) % len(curve)]
        if curve[k, 0] == 0.0 and curve[(k + 1) % len(curve), 0] == 0.0:
            continue
        low_next, high_next = np.roll(low, -1), np.roll(high, -1)
        if curve[k, 0] > 0.0:
            triangles.append(np.column_stack([low, high_next, low_next]))
        if curve[(k + 1) % len(curve), 0] > 0.0:
            triangles.append(np.column_stack([low, high, high_next]))
    return Surface(np.array(points), np.vstack(triangles).astype(np.int32))


def torus(radius: float = 0.35, tube: float = 0.1, segments: int = 24, around: int = 10) -> Surface:
    """A ring [m] about the y axis.

    Parameters
    ----------
    radius : to the middle of the tube [m]
    tube : radius of the tube [m]
    segments : about the y axis
    around : points around the tube
    """
    angle = 2.0 * np.pi * np.arange(around) / around
    return turned(np.column_stack([radius + tube * np.cos(angle), tube * np.sin(angle)]), segments)


def cylinder(radius: float = 0.5, length: float = 1.0, segments: int = 24) -> Surface:
    """A cylinder [m] along the y axis, about the origin.

    Parameters
    ----------
    radius, length : [m]
    segments : around the axis
    """
    half = length / 2.0
    return turned([(0.0, -half), (radius, -half), (radius, half), (0.0, half)], segments)


def funnel(
    mouth: float = 0.4,
    neck: float = 0.1,
    height: float = 0.5,
    pipe: float = 0.2,
    thickness: float = 0.02,
    segments: int = 32,
) -> Surface:
    """A funnel [m] with walls: from its `mouth` (radius) at y = 0 down to its `neck` (radius) at -height, and a pipe
    below.

    Parameters
    ----------
    mouth, neck : inner radii [m]
    height : from neck to mouth [m]
    pipe : its length [m]
    thickness : of the wall [m]
    segments : around the axis
    """
    inner = np.array([(mouth, 0.0), (neck, -height), (neck, -height - pipe)])
    outer = inner + [thickness, 0.0]
    return turned(np.vstack([outer[::-1], inner]), segments)


def bowl(
    radius: float = 1.0, depth: float = 0.6, thickness: float = 0.05, around: int = 72, rings: int = 18
) -> Surface:
    """A bowl [m] open along y, half an ellipsoid inside; its foot is at y = 0, its rounded rim at y = thickness + depth
    + thickness / 2.

    Parameters
    ----------
    radius, depth : of the inside [m]
    thickness : of the wall [m]
    around : points of each ring
    rings : between the foot and the rim
    """
    angle = np.linspace(0.0, np.pi / 2.0, rings + 1)
    arc = np.column_stack([np.sin(angle), -np.cos(angle)])
    lip = np.linspace(0.0, np.pi, 9)[1:-1]
    lip = np.column_stack([radius + thickness / 2.0 + thickness / 2.0 * np.cos(lip), thickness / 2.0 * np.sin(lip)])
    profile = np.vstack([arc * [radius + thickness, depth + thickness], lip, (arc * [radius, depth])[::-1]])
    return turned(np.maximum(profile + [0.0, depth + thickness], 0.0), around)
