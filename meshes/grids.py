"""Solids of regular cells, made without a mesher: the same mesh everywhere, as thin or as coarse as one likes."""

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Solid


def brick(
    size: ArrayLike = (1.0, 1.0, 1.0),
    cuts: Sequence[int] = (1, 1, 1),
    bend: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Solid:
    """A box [m] about the origin cut into `cuts` boxes along x, y, z, each of them into six tetrahedra round its
    diagonal (Kuhn).

    `bend` moves the points (n, 3) [m], turning no cell inside out.
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
