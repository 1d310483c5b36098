"""Solids of regular cells, made without a mesher: the same mesh everywhere, as thin or as coarse as one likes."""

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Solid
from .solids import ball


def hollow_ball(radius: float = 1.0, thickness: float = 0.1, subdivisions: int = 2, layers: int = 1) -> Solid:
    """A ball [m] about the origin with a wall of a thickness around a cavity: `layers` of prisms over the triangles of
    `ball(radius, subdivisions)`, each cut into three tetrahedra.
    """
    if not 0.0 < thickness < radius:
        raise ValueError(f"thickness = {thickness!r} must lie between 0 and the radius {radius!r}")
    outside = ball(radius, subdivisions)
    shells = np.linspace(1.0 - thickness / radius, 1.0, layers + 1)
    return layered([fraction * outside.vertices for fraction in shells], outside.triangles)


def layered(sheets: Sequence[np.ndarray], triangles: np.ndarray) -> Solid:
    """Prisms between sheets that lie upon each other, each cut into three tetrahedra.

    Parameters
    ----------
    sheets : the vertices (n, 3) [m] of each sheet, from one face to the other
    triangles : (t, 3) of each sheet
    """
    count, points = len(sheets[0]), np.concatenate(sheets)
    # Corners in ascending order: prisms that share a side cut it along the same diagonal.
    a, b, c = np.sort(triangles, axis=1).T
    cells = []
    for low in range(0, (len(sheets) - 1) * count, count):
        up = low + count
        for cell in (
            (a + low, b + low, c + low, c + up),
            (a + low, b + low, b + up, c + up),
            (a + low, a + up, b + up, c + up),
        ):
            cells.append(np.column_stack(cell))
    found = np.concatenate(cells)
    turned = np.linalg.det(points[found[:, 1:]] - points[found[:, :1]]) < 0.0
    found[turned, :2] = found[turned, 1::-1]
    return Solid(points, found.astype(np.int32), np.zeros(len(found), np.int32))


def brick(
    size: ArrayLike = (1.0, 1.0, 1.0),
    cuts: Sequence[int] = (1, 1, 1),
    bend: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Solid:
    """A box [m] about the origin cut into `cuts` boxes along x, y, z, each of them into six tetrahedra round its
    diagonal (Kuhn).

    Parameters
    ----------
    size : (3,) lengths of its sides [m]
    cuts : (3,) how many boxes along x, y, z
    bend : function of points (n, 3) [m] that gives their places (n, 3) [m] and turns no cell inside out
    """
    counts = np.asarray(cuts) + 1
    grid = np.stack(np.meshgrid(*(np.linspace(-0.5, 0.5, n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    strides = np.array([counts[1] * counts[2], counts[2], 1])
    corners = np.stack(np.meshgrid(*(np.arange(n) for n in cuts), indexing="ij"), axis=-1).reshape(-1, 3) @ strides
    cells = []
    for order in permutations(range(3)):
        path = np.cumsum([0, *(strides[axis] for axis in order)])
        odd = np.linalg.det(np.eye(3)[list(order)]) < 0
        cells.append(corners[:, None] + path[[0, 1, 3, 2] if odd else [0, 1, 2, 3]])
    points = grid * np.asarray(size, dtype=float)
    labels = np.zeros(sum(map(len, cells)), np.int32)
    return Solid(points if bend is None else bend(points), np.vstack(cells).astype(np.int32), labels)


def hollow_brick(size: ArrayLike = (1.0, 1.0, 1.0), cuts: Sequence[int] = (5, 5, 5), wall: int = 1) -> Solid:
    """A box [m] about the origin with a closed cavity: `brick` without its inner boxes.

    Parameters
    ----------
    size : (3,) lengths of its sides [m]
    cuts : (3,) how many boxes along x, y, z
    wall : its thickness, in boxes

    Raises
    ------
    ValueError
        A wall so thick leaves no cavity.
    """
    if wall < 1 or min(cuts) <= 2 * wall:
        raise ValueError(f"wall = {wall!r} leaves no cavity in {tuple(cuts)} boxes")
    whole = brick(size, cuts)
    middles = whole.vertices[whole.cells].mean(axis=1) / np.asarray(size, dtype=float) * np.asarray(cuts)
    kept = whole.cells[(np.abs(middles) > np.asarray(cuts) / 2.0 - wall).any(axis=1)]
    used, cells = np.unique(kept, return_inverse=True)
    return Solid(whole.vertices[used], cells.reshape(kept.shape).astype(np.int32), np.zeros(len(kept), np.int32))
