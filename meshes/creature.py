"""A round, smiling bear, sitting: the default shape of demos/drop.py."""

from functools import lru_cache, partial

import numpy as np

from .geometry import Surface
from .implicit import capsule, ellipsoid, figurine, groove, mirrored, shaped


@lru_cache(maxsize=4)  # a second to make, as the figures of jellies.py
def creature(height: float = 1.0, vertices: int = 4000, plumpness: float = 1.0) -> Surface:
    """A bear cub `height` [m] tall, y up, facing +z, centred on the y axis, its lowest point at y = 0.

    Ellipsoids and capsules joined by a smooth minimum, contoured by marching cubes, faired, and decimated where it is
    plain.

    Parameters
    ----------
    height : float [m]
    vertices : int
        Vertices of the surface, about.
    plumpness : scales the belly and cheeks
    """
    box = ((-0.56, 0.56), (-0.10, 1.12), (-0.50, 0.60))
    return figurine(partial(_figure, plumpness=plumpness), box, height, vertices)


def _figure(p: np.ndarray, plumpness: float) -> np.ndarray:
    """Signed distance (nearly) to the cub at points (..., 3): negative inside."""
    q = mirrored(p)
    body = ellipsoid(p, (0.0, 0.30, 0.0), np.array([0.25, 0.29, 0.23]) * plumpness)
    parts = [
        (ellipsoid(p, (0.0, 0.76, 0.03), (0.27, 0.235, 0.235)), 0.06),  # head
        (ellipsoid(q, (0.12, 0.69, 0.15), np.array([0.12, 0.10, 0.10]) * plumpness), 0.06),  # cheeks
        (ellipsoid(p, (0.0, 0.69, 0.235), (0.125, 0.095, 0.115)), 0.03),  # muzzle
        (ellipsoid(p, (0.0, 0.748, 0.338), (0.046, 0.034, 0.034)), 0.012),  # nose
        (ellipsoid(q, (0.100, 0.825, 0.228), (0.042, 0.050, 0.042)), 0.008),  # eyes
        (ellipsoid(q, (0.215, 0.965, 0.0), (0.098, 0.105, 0.058)), 0.03),  # ears
        (capsule(q, (0.20, 0.47, 0.05), (0.40, 0.36, 0.22), 0.078), 0.05),  # arms, held out for a hug
        (capsule(q, (0.15, 0.10, 0.10), (0.26, 0.08, 0.38), 0.100), 0.05),  # legs
        (ellipsoid(q, (0.275, 0.115, 0.42), (0.105, 0.125, 0.07)), 0.03),  # feet, soles forward
        (ellipsoid(p, (0.0, 0.16, -0.25), (0.085, 0.085, 0.085)), 0.03),  # tail
    ]
    hollows = [
        (ellipsoid(q, (0.215, 0.975, 0.062), (0.058, 0.062, 0.030)), 0.02),  # inside of the ears
        (ellipsoid(p, (0.0, 0.27, 0.245), (0.022, 0.022, 0.03)), 0.015),  # navel
        (groove(q, [(0.0, 0.651, 0.344), (0.052, 0.660, 0.333), (0.100, 0.690, 0.302)], 0.014), 0.02),  # smile
    ]
    return shaped(body, parts, hollows)
