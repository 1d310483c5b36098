"""Flat things to throw about: letters, a propeller, a worm, a trampoline and a beach ball."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from pdvol.meshes import Outline, Solid
from pdvol.meshes.outlines import disc, polygon, triangles_of


def letter(name: str, height: float = 0.5) -> Outline | Solid:
    """The capital A, B or C, `height` [m] tall, about the origin; A and B have holes and are triangulated."""
    letters: dict[str, Callable[[], Outline | Solid]] = {"A": _a, "B": _b, "C": _c}
    shape = letters[name]()
    points = shape.points if isinstance(shape, Outline) else shape.vertices
    points = height * (points - [0.0, 0.5])
    return Outline(points) if isinstance(shape, Outline) else Solid(points, shape.cells, shape.regions)


def propeller(radius: float = 0.3, blades: int = 3, hub: float = 0.25, points: int = 240) -> Solid:
    """Blades of a `radius` [m] swept about the origin, with a round hole in the hub; `hub` is the hub's radius over the
    blades'. `points` of the outline.
    """
    angle = 2.0 * np.pi * np.arange(points) / points
    reach = hub + (1.0 - hub) * (0.5 + 0.5 * np.cos(blades * angle)) ** 1.3
    swept = angle + 0.45 * (reach - hub)
    outline = radius * reach[:, None] * np.column_stack([np.cos(swept), np.sin(swept)])
    return pierced(Outline(outline), disc(0.42 * hub * radius, 24))


def worm(length: float = 0.9, width: float = 0.16, waves: float = 1.25, sway: float = 0.09) -> Outline:
    """A wavy worm [m] along x about the origin, its thick head at the right: `waves` periods of its middle line, with
    the amplitude `sway` [m].
    """
    x = np.linspace(-0.5, 0.5, 81)
    middle = np.column_stack([length * x, sway * np.sin(2.0 * np.pi * waves * x)])
    head = 0.28 * np.exp(-(((x - 0.44) / 0.09) ** 2))
    return stroke(middle, width * (0.72 + 0.28 * np.tanh(5.0 * (x + 0.5)) + head))


def trampoline(width: float = 2.6, height: float = 0.6, bed: float = 0.05, leg: float = 0.1) -> Outline:
    """A `bed` [m] thick on two legs, `leg` [m] wide, that stand at y = 0; its top is at y = `height`, its middle at
    x = 0.
    """
    half, under = width / 2.0, height - bed
    corners = [
        (half - leg, 0.0),
        (half, 0.0),
        (half, height),
        (-half, height),
        (-half, 0.0),
        (leg - half, 0.0),
        (leg - half, under),
        (half - leg, under),
    ]
    return polygon(rounded(np.array(corners), 0.4 * leg))


def beach_ball(radius: float = 0.2, panels: int = 6, points: int = 96) -> Solid:
    """A disc of a `radius` [m] about the origin whose cells are labelled by panel, 1 to `panels`, and 0 in the round
    cap where these meet. `points` of the rim.
    """
    rim, cap = disc(radius, points).points, disc(0.22 * radius, points).points
    here = np.arange(points)
    there = np.roll(here, -1)
    inner, outer = 1 + here, 1 + points + here
    cells = np.vstack(
        [
            np.column_stack([np.zeros(points, dtype=int), inner, inner[there]]),
            np.column_stack([inner, outer, outer[there]]),
            np.column_stack([inner, outer[there], inner[there]]),
        ]
    )
    panel = 1 + here * panels // points
    return Solid(
        np.vstack([np.zeros((1, 2)), cap, rim]),
        cells.astype(np.int32),
        np.concatenate([0 * panel, panel, panel]).astype(np.int32),
    )


# ---- tools


def stroke(middle: np.ndarray, width: ArrayLike, cap: int = 12) -> Outline:
    """The outline of a pen drawn along the curve `middle` (n, 2) [m], round at both ends; `width` [m], one for all or
    one a point.
    """
    along = np.gradient(middle, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    half = np.broadcast_to(np.asarray(width, dtype=float) / 2.0, len(middle))[:, None]
    side = half * np.column_stack([-along[:, 1], along[:, 0]])
    turn = np.linspace(0.0, np.pi, cap + 1)[1:-1, None]
    end = middle[-1] - np.cos(turn) * side[-1] + np.sin(turn) * half[-1] * along[-1]
    start = middle[0] + np.cos(turn) * side[0] - np.sin(turn) * half[0] * along[0]
    return Outline(np.vstack([middle - side, end, (middle + side)[::-1], start]))


def rounded(points: np.ndarray, radius: float, arc: int = 6) -> np.ndarray:
    """The polygon (n, 2) with its corners rounded by arcs of `radius` [m], less where a side is too short; turns below
    30 degrees stay.
    """
    result = []
    for before, corner, after in zip(np.roll(points, 1, axis=0), points, np.roll(points, -1, axis=0), strict=True):
        u, w = before - corner, after - corner
        shorter = min(np.linalg.norm(u), np.linalg.norm(w))
        u, w = u / np.linalg.norm(u), w / np.linalg.norm(w)
        half = np.arccos(np.clip(u @ w, -1.0, 1.0)) / 2.0  # of the angle between the two sides
        if half > np.radians(75.0):
            result.append(corner)
            continue
        r = min(radius, 0.45 * shorter * np.tan(half))
        middle = (u + w) / np.linalg.norm(u + w)
        centre, across = corner + r / np.sin(half) * middle, (u - w) / np.linalg.norm(u - w)
        angle = np.linspace(np.pi / 2.0 - half, half - np.pi / 2.0, arc + 1)[:, None]
        result.extend(centre + r * (np.sin(angle) * across - np.cos(angle) * middle))
    return np.array(result)


def pierced(outer: Outline, *holes: Outline) -> Solid:
    """Triangles between an outline and the holes within it, which must neither meet it nor each other. It is meshed
    anew on every level.
    """
    points, ring, first = [outer.points], list(range(len(outer.points))), len(outer.points)
    for hole in sorted(
        holes, key=lambda hole: -hole.points[:, 0].max()
    ):  # from the right: what a cut to the right meets is in the ring by then
        points.append(hole.points)
        everything = np.vstack(points)
        start = int(np.argmax(hole.points[:, 0]))
        inner = [first + (start - k) % len(hole.points) for k in range(len(hole.points))]  # clockwise
        k = _seen(everything, ring, everything[inner[0]])
        ring = [*ring[: k + 1], *inner, inner[0], *ring[k:]]
        first += len(hole.points)
    everything = np.vstack(points)
    cells = np.array(ring)[triangles_of(everything[ring])]
    return Solid(everything, cells.astype(np.int32), np.zeros(len(cells), dtype=np.int32))


def _seen(points: np.ndarray, ring: list[int], eye: np.ndarray) -> int:
    """Where in the ring the nearest point is that a straight cut from `eye` reaches without crossing the ring."""
    a, b = points[ring], points[np.roll(ring, -1)]

    def side(p: np.ndarray, q: np.ndarray, r: np.ndarray) -> np.ndarray:
        return np.sign(
            (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])
        )

    for k in np.argsort(np.linalg.norm(a - eye, axis=1)):
        there = a[k]
        apart = (a != there).any(axis=1) & (b != there).any(axis=1)
        crossed = apart & (side(eye, there, a) * side(eye, there, b) <= 0) & (side(a, b, eye) * side(a, b, there) <= 0)
        if there[0] > eye[0] and not crossed.any():
            return int(k)
    raise ValueError("a hole lies outside of the outline")


def _arc(centre: ArrayLike, radius: float, start: float, end: float, points: int = 24) -> np.ndarray:
    """Points of an arc from `start` to `end` [degrees]."""
    angle = np.radians(np.linspace(start, end, points))[:, None]
    return np.asarray(centre) + radius * np.hstack([np.cos(angle), np.sin(angle)])


# ---- letters of height one, from y = 0 to 1


def _a() -> Solid:
    half = np.array([(0.22, 0.0), (0.47, 0.0), (0.14, 1.0)])  # the right leg; its sides are parallel
    bar, top = 0.18, 0.36
    slope = (half[1, 0] - half[2, 0]) / 1.0
    left = half[::-1] * [-1.0, 1.0]
    x = half[0, 0] - slope * bar
    outer = np.vstack([half, left, [(-x, bar), (x, bar)]])
    x = half[0, 0] - slope * top
    hole = np.array([(-x, top), (x, top), (0.0, half[0, 0] / slope)])
    return pierced(polygon(rounded(outer, 0.05)), polygon(rounded(hole, 0.02)))


def _b() -> Solid:
    left, low, high = -0.32, _arc((0.05, 0.28), 0.28, -90.0, 68.0), _arc((0.02, 0.765), 0.235, -58.0, 90.0)
    outer = np.vstack([[(left, 0.0)], low, high, [(left, 1.0)]])
    stem = left + 0.17
    holes = []
    for x, bottom, top in ((0.05, 0.15, 0.44), (0.02, 0.60, 0.855)):
        r = (top - bottom) / 2.0
        holes.append(
            polygon(rounded(np.vstack([[(stem, bottom)], _arc((x, bottom + r), r, -90.0, 90.0), [(stem, top)]]), 0.03))
        )
    return pierced(polygon(rounded(outer, 0.05)), *holes)


def _c() -> Outline:
    width = 0.18
    angle = np.radians(np.linspace(-48.0, -312.0, 61))[:, None]
    return stroke(np.array([0.06, 0.5]) + np.hstack([0.35 * np.cos(angle), (0.5 - width / 2.0) * np.sin(angle)]), width)
