"""Figures as signed distances on a grid, joined from parts and then contoured."""

from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import ArrayLike

from pdvol.meshes import Outline, Surface
from pdvol.meshes.implicit import contoured, join
from pdvol.meshes.outlines import polygon


class Field:
    """A figure about one unit large, in cells of size `h` between (low, high) along each axis.

    Attributes
    ----------
    p, q : points of the grid (..., d), and the same mirrored to x >= 0, for parts that are left and right
    values : signed distances there, negative inside
    """

    def __init__(self, h: float, *ranges: tuple[float, float]):
        self.h, self.axes = h, [np.arange(low, high, h) for low, high in ranges]
        self.p = np.stack(np.meshgrid(*self.axes, indexing="ij"), axis=-1)
        self.q = self.p.copy()
        self.q[..., 0] = np.abs(self.q[..., 0])
        self.values = np.full(self.p.shape[:-1], 1.0)

    def join(self, parts: Iterable[tuple[np.ndarray, float]]) -> "Field":
        """Join parts: their distances on the grid, and the size of the fillet between each and the rest."""
        for distances, blend in parts:
            self.values = join(self.values, distances, blend)
        return self

    def join_within(self, distance: Callable[[np.ndarray], np.ndarray], blend: float, low: ArrayLike, high: ArrayLike):
        """Join a part by its function of points, within the box of corners `low` and `high` alone."""
        ends = zip(self.axes, np.asarray(low), np.asarray(high), strict=True)
        box = tuple(slice(int(np.searchsorted(axis, a)), int(np.searchsorted(axis, b))) for axis, a, b in ends)
        self.values[box] = join(self.values[box], distance(self.p[box]), blend)

    def cut(self, distances: np.ndarray, blend: float) -> None:
        """Take away where distances are negative, with a rounded edge."""
        self.values = -join(-self.values, distances, blend)

    def flatten(self, height: float, blend: float) -> None:
        """Take away what is below a height."""
        self.cut(self.p[..., 1] - height, blend)

    def contour(self, vertices: int) -> tuple[np.ndarray, np.ndarray]:
        """Points and triangles of the contour, of about so many `vertices`."""
        points, triangles = contoured(self.values, self.axes, self.h, vertices)
        return points, np.ascontiguousarray(triangles, dtype=np.int32)

    def surface(self, vertices: int, axis: int, size: float) -> Surface:
        """The contour, scaled so that it is `size` long along an axis, its lowest point at y = 0."""
        points, triangles = self.contour(vertices)
        points = points - [0.0, points[:, 1].min(), 0.0]
        return Surface(points * (size / np.ptp(points[:, axis])), triangles)

    def outline(self, points: int, height: float) -> Outline:
        """Of a flat figure: the contour by `points` at equal distances, `height` tall, its lowest point at y = 0."""
        from skimage import measure

        ring = max(measure.find_contours(self.values, 0.0), key=len)[:-1] * self.h + [axis[0] for axis in self.axes]
        ring = np.vstack([ring, ring[:1]])
        length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(ring, axis=0), axis=1))])
        at = np.linspace(0.0, length[-1], points + 1)[:-1]
        even = np.column_stack([np.interp(at, length, ring[:, k]) for k in range(2)])
        even = even - [0.0, even[:, 1].min()]
        return polygon(even * (height / even[:, 1].max()))
