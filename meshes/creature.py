"""A round, smiling bear, sitting: the default shape of demos/drop.py."""

import igl
import numpy as np
from skimage import measure

from .geometry import Surface


def creature(height: float = 1.0, vertices: int = 4000, plumpness: float = 1.0) -> Surface:
    """A bear cub `height` [m] tall, y up, facing +z, centred on the y axis, its lowest point at y = 0.

    Ellipsoids and capsules joined by a smooth minimum, contoured by marching cubes, faired, and decimated where it is plain.

    Parameters
    ----------
    height : float [m]
    vertices : int
        Vertices of the surface, about.
    plumpness : scales the belly and cheeks
    """
    h = 0.014  # grid cell of a figure about one unit tall: five cells across the nose
    axes = [np.arange(low, high, h) for low, high in ((-0.56, 0.56 + h), (-0.10, 1.12 + h), (-0.50, 0.60 + h))]
    field = _figure(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1), plumpness)
    points, triangles, _, _ = measure.marching_cubes(field, 0.0, spacing=(h, h, h))
    points = points.astype(float) + np.array([a[0] for a in axes])
    points = _fair(points, triangles.astype(np.int64), 14)
    if len(points) > vertices:
        points, triangles, _, _ = igl.qslim(
            np.asfortranarray(points), np.asfortranarray(triangles, dtype=np.int32), max_m=2 * (vertices - 2), block_intersections=True
        )
    points = points - [0.0, points[:, 1].min(), 0.0]
    return Surface(points * (height / points[:, 1].max()), np.ascontiguousarray(triangles, dtype=np.int32))


def _figure(p: np.ndarray, plumpness: float) -> np.ndarray:
    """Signed distance (nearly) to the cub at points (..., 3): negative inside."""
    q = p.copy()
    q[..., 0] = np.abs(q[..., 0])  # left and right are the same
    body = _ellipsoid(p, (0.0, 0.30, 0.0), np.array([0.25, 0.29, 0.23]) * plumpness)
    parts = [
        (_ellipsoid(p, (0.0, 0.76, 0.03), (0.27, 0.235, 0.235)), 0.06),  # head
        (_ellipsoid(q, (0.12, 0.69, 0.15), np.array([0.12, 0.10, 0.10]) * plumpness), 0.06),  # cheeks
        (_ellipsoid(p, (0.0, 0.69, 0.235), (0.125, 0.095, 0.115)), 0.03),  # muzzle
        (_ellipsoid(p, (0.0, 0.748, 0.338), (0.046, 0.034, 0.034)), 0.012),  # nose
        (_ellipsoid(q, (0.100, 0.825, 0.228), (0.042, 0.050, 0.042)), 0.008),  # eyes
        (_ellipsoid(q, (0.215, 0.965, 0.0), (0.098, 0.105, 0.058)), 0.03),  # ears
        (_capsule(q, (0.20, 0.47, 0.05), (0.40, 0.36, 0.22), 0.078), 0.05),  # arms, held out for a hug
        (_capsule(q, (0.15, 0.10, 0.10), (0.26, 0.08, 0.38), 0.100), 0.05),  # legs
        (_ellipsoid(q, (0.275, 0.115, 0.42), (0.105, 0.125, 0.07)), 0.03),  # feet, soles forward
        (_ellipsoid(p, (0.0, 0.16, -0.25), (0.085, 0.085, 0.085)), 0.03),  # tail
    ]
    for part, blend in parts:
        body = _join(body, part, blend)
    hollows = [
        (_ellipsoid(q, (0.215, 0.975, 0.062), (0.058, 0.062, 0.030)), 0.02),  # inside of the ears
        (_ellipsoid(p, (0.0, 0.27, 0.245), (0.022, 0.022, 0.03)), 0.015),  # navel
        (_smile(q), 0.02),
    ]
    for hollow, blend in hollows:
        body = -_join(-body, hollow, blend)
    return body


def _smile(q: np.ndarray) -> np.ndarray:
    """A groove across the muzzle, its ends drawn up."""
    points = [(0.0, 0.651, 0.344), (0.052, 0.660, 0.333), (0.100, 0.690, 0.302)]
    first, second = (_capsule(q, a, b, 0.014) for a, b in zip(points[:-1], points[1:], strict=True))
    return np.minimum(first, second)


def _ellipsoid(p: np.ndarray, centre, radii) -> np.ndarray:
    """First-order distance to an ellipsoid."""
    radii = np.asarray(radii, dtype=float)
    r = (p - np.asarray(centre)) / radii
    k0, k1 = np.linalg.norm(r, axis=-1), np.linalg.norm(r / radii, axis=-1)
    return k0 * (k0 - 1.0) / np.maximum(k1, 1e-9)


def _capsule(p: np.ndarray, start, end, radius: float) -> np.ndarray:
    """Distance to a segment thickened by `radius`."""
    a, axis = np.asarray(start), np.asarray(end) - np.asarray(start)
    along = np.clip((p - a) @ axis / (axis @ axis), 0.0, 1.0)
    return np.linalg.norm(p - a - along[..., None] * axis, axis=-1) - radius


def _join(a: np.ndarray, b: np.ndarray, blend: float) -> np.ndarray:
    """Smooth minimum: the two where they are apart, a fillet of size `blend` where they meet."""
    mix = np.maximum(blend - np.abs(a - b), 0.0) / blend
    return np.minimum(a, b) - 0.25 * blend * mix**2


def _fair(vertices: np.ndarray, triangles: np.ndarray, rounds: int) -> np.ndarray:
    """Taubin smoothing: evens out marching cubes' slivers without shrinking the figure."""
    adjacency = igl.adjacency_matrix(triangles).astype(float)
    degree = np.asarray(adjacency.sum(axis=1)).ravel()[:, None]
    for _ in range(rounds):
        for factor in (0.5, -0.52):
            vertices = vertices + factor * (adjacency @ vertices / degree - vertices)
    return vertices
