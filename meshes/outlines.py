"""Flat shapes, as closed outlines; and what extruding one gives."""

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Outline, Surface

FLAT = 1e-6  # twice a triangle's area over the square of its base: below it points count as on a line


def disc(radius: float = 1.0, points: int = 128) -> Outline:
    """A circle about the origin [m].

    Parameters
    ----------
    radius : [m]
    points : of the outline
    """
    angle = 2.0 * np.pi * np.arange(points) / points
    return Outline(radius * np.column_stack([np.cos(angle), np.sin(angle)]))


def polygon(points: ArrayLike) -> Outline:
    """The polygon through `points` (n, 2) [m], turned anticlockwise."""
    corners = np.asarray(points, dtype=float)
    x, y = corners.T
    area = np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    return Outline(corners if area > 0 else corners[::-1].copy())


def rectangle(width: float = 1.0, height: float = 1.0) -> Outline:
    """A rectangle [m] about the origin.

    Parameters
    ----------
    width, height : along x and y [m]
    """
    w, h = width / 2.0, height / 2.0
    return Outline(np.array([[-w, -h], [w, -h], [w, h], [-w, h]]))


def spike(
    width: float = 0.4, height: float = 1.0, tip_radius: float = 0.0, base: float = 0.0, thickness: float = 0.1
) -> Outline:
    """A spike pointing up along y, its tip at (0, height), the foot of its flanks at y = 0.

    Parameters
    ----------
    width, height : of the flanks' triangle [m]
    tip_radius : rounds the tip [m]; 0 is a sharp point. The rounded tip ends below `height`.
    base : width [m] of a slab below the spike; none where it is 0
    thickness : of that slab [m]
    """
    half = width / 2.0
    tip = np.array([[0.0, height]])
    if tip_radius > 0.0:
        slant = np.arctan2(height, half)  # of a flank over the ground: the arc spans its normals
        centre = np.array([0.0, height - tip_radius / np.cos(slant)])
        angle = np.linspace(np.pi / 2.0 - slant, np.pi / 2.0 + slant, 17)
        tip = centre + tip_radius * np.column_stack([np.cos(angle), np.sin(angle)])
    foot = np.array([[-half, 0.0], [half, 0.0]])
    if base <= 0.0:
        return Outline(np.vstack([foot, tip]))
    b = max(base, width) / 2.0
    slab = (
        [[-b, 0.0], [-b, -thickness], [b, -thickness], [b, 0.0]]
        if base > width
        else [[-b, -thickness], [b, -thickness]]
    )
    return Outline(np.vstack([foot[:1], slab, foot[1:], tip]))


def comb(teeth: int = 4, length: float = 1.0, width: float = 0.1, gap: float = 0.02, spine: float = 0.15) -> Outline:
    """Long thin teeth [m] along y, `gap` apart, joined at their lower end by a spine: near in space, far along the
    body.

    Parameters
    ----------
    teeth : how many
    length, width : of a tooth [m]
    gap : between teeth [m]
    spine : its height [m]
    """
    pitch = width + gap
    total = teeth * width + (teeth - 1) * gap
    points = [[0.0, -spine], [total, -spine]]
    for k in reversed(range(teeth)):
        left = k * pitch
        points += [[left + width, 0.0]] if k < teeth - 1 else []
        points += [[left + width, length], [left, length]]
        points += [[left, 0.0]] if k > 0 else []
    return Outline(np.array(points))


def rope(
    length: float = 2.0, width: float = 0.05, waves: float = 1.5, swing: float = 0.1, points: int = 160
) -> Outline:
    """A hanging strip [m] along y, its lower end at the origin, its middle line a sine of `waves` periods that swings
    by `swing`.

    Parameters
    ----------
    length, width : of the strip [m]
    waves : periods of the sine
    swing : its amplitude [m]
    points : of each side
    """
    y = np.linspace(0.0, length, points)
    wave = 2.0 * np.pi * waves / length
    middle = np.column_stack([swing * np.sin(wave * y), y])
    along = np.column_stack([swing * wave * np.cos(wave * y), np.ones(points)])
    across = 0.5 * width * np.column_stack([along[:, 1], -along[:, 0]]) / np.linalg.norm(along, axis=1, keepdims=True)
    return Outline(np.vstack([middle + across, (middle - across)[::-1]]))


def slit_array(
    slits: int = 6, strip: float = 0.1, height: float = 1.0, slit: float = 0.03, bridge: float = 0.12
) -> Outline:
    """A block [m] on the x axis with vertical slits, open in turn at its upper and its lower end: strips joined by
    bridges, a soft spring.

    Parameters
    ----------
    slits : how many; there is one strip more
    strip, slit : widths [m]
    bridge : height [m] of what a slit leaves at its closed end
    """
    pitch = strip + slit
    total = (slits + 1) * strip + slits * slit
    below = [[0.0, 0.0]]
    for left in (strip + k * pitch for k in range(1, slits, 2)):
        below += [[left, 0.0], [left, height - bridge], [left + slit, height - bridge], [left + slit, 0.0]]
    above = [[total, height]]
    for left in reversed([strip + k * pitch for k in range(0, slits, 2)]):
        above += [[left + slit, height], [left + slit, bridge], [left, bridge], [left, height]]
    return Outline(np.array([*below, [total, 0.0], *above, [0.0, height]]))


def folded(length: float = 1.0, width: float = 0.1, gap: float = 0.02, arc: int = 24) -> Outline:
    """A strip bent into a U lying on its side: two arms [m] along x, `gap` apart, joined by a half ring at x =
    `length`.

    Parameters
    ----------
    length : of the arms [m]
    width : of the strip [m]
    gap : between the arms [m]
    arc : points of each half ring
    """
    angle = np.linspace(-np.pi / 2.0, np.pi / 2.0, arc)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    outer, inner = (gap / 2.0 + width) * ring, (gap / 2.0) * ring
    shift = np.array([length, 0.0])
    free = (
        np.array([[0.0, -gap / 2.0 - width]]),
        np.array([[0.0, gap / 2.0 + width], [0.0, gap / 2.0]]),
        np.array([[0.0, -gap / 2.0]]),
    )
    return Outline(np.vstack([free[0], shift + outer, free[1], shift + inner[::-1], free[2]]))


def extrude(outline: Outline, thickness: float) -> Surface:
    """The prism over an outline, from z = -thickness/2 to +thickness/2 [m]; sides and caps are as coarse as it."""
    n = len(outline.points)
    z = np.full((n, 1), thickness / 2.0)
    vertices = np.vstack([np.hstack([outline.points, -z]), np.hstack([outline.points, z])])
    cap = triangles_of(outline.points)
    here = np.arange(n)
    there = np.roll(here, -1)
    sides = np.vstack([np.column_stack([here, there, there + n]), np.column_stack([here, there + n, here + n])])
    return Surface(vertices, np.vstack([cap[:, ::-1], cap + n, sides]).astype(np.int32))


def triangles_of(points: np.ndarray) -> np.ndarray:
    """Triangles (n - 2, 3) of an anticlockwise polygon by cutting ears, the roundest first; it may touch itself along
    cuts to its holes.
    """
    left = list(range(len(points)))
    triangles = []

    def turn(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        u, w = b - a, c - a
        return u[..., 0] * w[..., 1] - u[..., 1] * w[..., 0]

    while len(left) > 3:
        best, score = 0, -np.inf
        ring = points[left]
        for k in range(len(left)):
            a, b, c = ring[k - 1], ring[k], ring[(k + 1) % len(left)]
            if turn(a, b, c) <= FLAT * ((c - a) @ (c - a)):
                continue
            inside = (turn(a, b, ring) >= 0) & (turn(b, c, ring) >= 0) & (turn(c, a, ring) >= 0)
            for corner in (a, b, c):
                inside &= (ring != corner).any(axis=1)
            value = -float(np.linalg.norm(c - a))
            if not inside.any() and value > score:
                best, score = k, value
        triangles.append([left[best - 1], left[best], left[(best + 1) % len(left)]])
        del left[best]
    return np.array([*triangles, left])
