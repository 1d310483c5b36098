"""Figures as signed distances (nearly), negative inside, and their contours as surfaces."""

from collections.abc import Callable, Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from .geometry import Surface

Blended = Iterable[tuple[np.ndarray, float]]
"""Distances to parts of a figure, and the size of the fillet of each."""


def figurine(
    figure: Callable[[np.ndarray], np.ndarray], box: Sequence[tuple[float, float]], height: float, vertices: int
) -> Surface:
    """The contour of a signed distance within `box`, ((low, high), ...) along x, y, z, scaled to its height; y up, its
    lowest point at y = 0.
    """
    h = 0.014  # grid cell of a figure about one unit tall: five cells across the bear's nose
    axes = [np.arange(low, high + h, h) for low, high in box]
    points, triangles = contoured(figure(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)), axes, h, vertices)
    points = points - [0.0, points[:, 1].min(), 0.0]
    return Surface(points * (height / points[:, 1].max()), np.ascontiguousarray(triangles, dtype=np.int32))


def contoured(field: np.ndarray, axes: Sequence[np.ndarray], h: float, vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and triangles where `field` on the grid of `axes`, spacing h, is zero: faired, decimated to `vertices`."""
    import igl  # these two take as long to load as the rest of a scene
    from skimage import measure

    points, triangles, _, _ = measure.marching_cubes(field, 0.0, spacing=(h, h, h))
    points = points.astype(float) + np.array([a[0] for a in axes])
    points = _fair(points, triangles.astype(np.int64), 14)
    if len(points) > vertices:
        points, triangles, _, _ = igl.qslim(
            np.asfortranarray(points),
            np.asfortranarray(triangles, dtype=np.int32),
            max_m=2 * (vertices - 2),
            block_intersections=True,
        )
    return points, triangles


def ellipsoid(p: np.ndarray, centre: ArrayLike, radii: ArrayLike) -> np.ndarray:
    """First-order distance to an ellipsoid."""
    radii = np.asarray(radii, dtype=float)
    r = (p - np.asarray(centre)) / radii
    k0, k1 = np.linalg.norm(r, axis=-1), np.linalg.norm(r / radii, axis=-1)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def capsule(p: np.ndarray, start: ArrayLike, end: ArrayLike, radius: float) -> np.ndarray:
    """Distance to a segment thickened by `radius`."""
    return cone(p, start, end, radius, radius)


def cone(p: np.ndarray, start: ArrayLike, end: ArrayLike, first: float, last: float) -> np.ndarray:
    """Distance, nearly, to a segment whose thickness goes from the radius `first` to `last`."""
    a, axis = np.asarray(start), np.asarray(end) - np.asarray(start)
    along = np.clip((p - a) @ axis / (axis @ axis), 0.0, 1.0)
    return np.linalg.norm(p - a - along[..., None] * axis, axis=-1) - (first + (last - first) * along)


def groove(p: np.ndarray, points: ArrayLike, radius: float) -> np.ndarray:
    """Distance to a path through `points` (k, 3), thickened by `radius`."""
    path = np.asarray(points)
    return np.min([capsule(p, a, b, radius) for a, b in zip(path[:-1], path[1:], strict=True)], axis=0)


def mirrored(p: np.ndarray) -> np.ndarray:
    """Points of the right side for those of both: left and right are the same."""
    return np.concatenate([np.abs(p[..., :1]), p[..., 1:]], axis=-1)


def shaped(body: np.ndarray, parts: Blended, hollows: Blended) -> np.ndarray:
    """A body joined with parts, without hollows."""
    for part, blend in parts:
        body = join(body, part, blend)
    for hollow, blend in hollows:
        body = -join(-body, hollow, blend)
    return body


def join(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Smooth minimum: the two where they are apart, a fillet of size `blend` where they meet."""
    mix = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.minimum(a, b) - 0.25 * blend * mix**2


def _fair(vertices: np.ndarray, triangles: np.ndarray, rounds: int) -> np.ndarray:
    """Taubin smoothing: evens out marching cubes' slivers without shrinking the figure."""

    import igl

    adjacency = igl.adjacency_matrix(triangles).astype(float)
    degree = np.asarray(adjacency.sum(axis=1)).ravel()[:, None]
    for _ in range(rounds):
        for factor in (0.5, -0.52):
            vertices = vertices + factor * (adjacency @ vertices / degree - vertices)
    return vertices
