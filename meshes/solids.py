"""Round and square surfaces to start from."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Surface
from .outlines import comb as flat_comb
from .outlines import extrude
from .outlines import folded as flat_folded


def ball(radius: float = 1.0, subdivisions: int = 3) -> Surface:
    """A sphere about the origin [m]: an icosahedron whose triangles are cut in four `subdivisions` times, 10 * 4^k + 2
    vertices.

    Parameters
    ----------
    radius : [m]
    subdivisions : how often each triangle is cut in four
    """
    import igl  # shapes that do not need it load faster without it

    vertices, triangles = igl.icosahedron()
    for _ in range(subdivisions):
        vertices, triangles = igl.upsample(np.asarray(vertices), np.asarray(triangles, dtype=np.int64))
    vertices = radius * vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    return Surface(np.ascontiguousarray(vertices), np.ascontiguousarray(triangles, dtype=np.int32))


def box(size: ArrayLike = (1.0, 1.0, 1.0), divisions: ArrayLike = (1, 1, 1)) -> Surface:
    """A box [m] about the origin, each side cut into `divisions` along x, y, z.

    Parameters
    ----------
    size : (3,) lengths of its sides [m]
    divisions : (3,) or one number: cuts along x, y, z
    """
    half, cuts = np.asarray(size, dtype=float) / 2.0, np.broadcast_to(divisions, 3)
    grids, triangles, n = [], [], 0
    for axis in range(3):
        u, w = (axis + 1) % 3, (axis + 2) % 3
        flat, quads = _grid(cuts[u], cuts[w])
        for side in (-1, 1):
            corners = np.empty((len(flat), 3))
            corners[:, axis] = side
            corners[:, [u, w]] = 2.0 * flat - 1.0
            grids.append(corners)
            triangles.append(n + (quads if side > 0 else quads[:, ::-1]))
            n += len(corners)
    points, index = np.unique(np.round(np.vstack(grids), 12), axis=0, return_inverse=True)
    return Surface(points * half, index.ravel()[np.vstack(triangles)].astype(np.int32))


def bar(length: float = 1.0, width: float = 0.2, height: float = 0.2, cell: float = 0.1) -> Surface:
    """A bar [m] along x about the origin, its sides cut into squares of about `cell`.

    Parameters
    ----------
    length, width, height : along x, z and y [m]
    cell : wanted edge length [m]
    """
    size = np.array([length, height, width])
    return box(size, np.maximum(np.round(size / cell), 1).astype(int))


def comb(thickness: float = 0.1, **parameters: Any) -> Surface:
    """`outlines.comb` with a thickness [m]."""
    return extrude(flat_comb(**parameters), thickness)


def folded(thickness: float = 0.1, **parameters: Any) -> Surface:
    """`outlines.folded` with a thickness [m]."""
    return extrude(flat_folded(**parameters), thickness)


def _grid(m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (., 2) of a unit square cut m by n, and its anticlockwise triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, m + 1), np.linspace(0, 1, n + 1), indexing="ij")
    number = np.arange((m + 1) * (n + 1)).reshape(m + 1, n + 1)
    a, b, c, d = number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    return np.column_stack([x.ravel(), y.ravel()]), np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
