"""A bear, a bunny and a frog in jelly: round, without thin parts, so that few vertices will do."""

from functools import lru_cache, partial

import numpy as np

from .geometry import Surface
from .implicit import capsule, ellipsoid, figurine, groove, mirrored, shaped


@lru_cache(maxsize=4)  # a second to make: a process that runs many variations of a scene makes it once
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
    return figurine(partial(_bear, plumpness=plumpness), box, height, vertices)


def bunny(height: float = 1.0, vertices: int = 4000) -> Surface:
    """A sitting bunny `height` [m] tall to the tips of its ears, y up, facing +z, its lowest point at y = 0.

    `vertices` of the surface, about.
    """
    return figurine(_bunny, ((-0.40, 0.40), (-0.06, 1.10), (-0.45, 0.50)), height, vertices)


@lru_cache(maxsize=4)
def frog(height: float = 0.6, vertices: int = 4000) -> Surface:
    """A squatting frog `height` [m] tall to the top of its eyes, y up, facing +z, its lowest point at y = 0.

    `vertices` of the surface, about.
    """
    return figurine(_frog, ((-0.68, 0.68), (-0.06, 0.80), (-0.60, 0.62)), height, vertices)


def _bear(p: np.ndarray, plumpness: float) -> np.ndarray:
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


def _bunny(p: np.ndarray) -> np.ndarray:
    q = mirrored(p)
    body = ellipsoid(p, (0.0, 0.26, -0.06), (0.225, 0.25, 0.27))
    parts = [
        (ellipsoid(p, (0.0, 0.33, 0.06), (0.16, 0.20, 0.16)), 0.08),  # chest
        (ellipsoid(p, (0.0, 0.585, 0.10), (0.190, 0.170, 0.185)), 0.05),  # head
        (ellipsoid(q, (0.070, 0.535, 0.235), (0.078, 0.065, 0.070)), 0.04),  # cheeks
        (ellipsoid(p, (0.0, 0.578, 0.300), (0.034, 0.026, 0.028)), 0.012),  # nose
        (ellipsoid(q, (0.108, 0.645, 0.222), (0.038, 0.046, 0.038)), 0.008),  # eyes
        (_ear(q), 0.04),
        (ellipsoid(q, (0.175, 0.19, -0.04), (0.105, 0.165, 0.185)), 0.04),  # thighs
        (capsule(q, (0.165, 0.062, 0.02), (0.185, 0.058, 0.24), 0.068), 0.04),  # hind feet
        (capsule(q, (0.095, 0.30, 0.14), (0.080, 0.070, 0.240), 0.062), 0.04),  # forelegs
        (ellipsoid(p, (0.0, 0.20, -0.345), (0.095, 0.095, 0.085)), 0.02),  # tail
    ]
    hollow = capsule(q, (0.092, 0.74, 0.112), (0.135, 0.93, 0.092), 0.034)  # inside of the ears
    return shaped(body, parts, [(hollow, 0.03)])


def _ear(q: np.ndarray) -> np.ndarray:
    """Long, a little flattened from front to back."""
    return capsule(q * [1.0, 1.0, 1.35] - [0.0, 0.0, 0.35 * 0.05], (0.080, 0.66, 0.05), (0.140, 0.985, 0.03), 0.080)


def _frog(p: np.ndarray) -> np.ndarray:
    q = mirrored(p)
    body = ellipsoid(p, (0.0, 0.27, -0.04), (0.30, 0.24, 0.32))
    parts = [
        (ellipsoid(p, (0.0, 0.40, 0.14), (0.29, 0.185, 0.235)), 0.07),  # head
        (ellipsoid(q, (0.165, 0.575, 0.165), (0.115, 0.115, 0.110)), 0.03),  # eyes' mounds
        (ellipsoid(q, (0.182, 0.595, 0.252), (0.052, 0.058, 0.042)), 0.008),  # pupils
        (ellipsoid(q, (0.315, 0.185, -0.15), (0.125, 0.175, 0.215)), 0.04),  # thighs
        (capsule(q, (0.385, 0.085, -0.22), (0.440, 0.070, 0.08), 0.078), 0.04),  # shanks
        (capsule(q, (0.225, 0.30, 0.16), (0.275, 0.080, 0.30), 0.068), 0.04),  # forelegs
        *(
            (capsule(q, (0.425, 0.060, 0.06), (x, 0.052, z), 0.052), 0.03)
            for x, z in ((0.56, 0.16), (0.475, 0.22), (0.385, 0.20))
        ),  # toes
        *(
            (capsule(q, (0.275, 0.065, 0.29), (x, 0.050, z), 0.050), 0.03)
            for x, z in ((0.365, 0.39), (0.275, 0.43), (0.190, 0.40))
        ),  # fingers
    ]
    return shaped(body, parts, [(_grin(q), 0.02)])


def _grin(q: np.ndarray) -> np.ndarray:
    """A groove round the head from eye to eye, on the head's own ellipsoid."""
    angles = np.linspace(0.0, 1.15, 7)
    y = 0.355 + 0.045 * (angles / angles[-1]) ** 2
    ring = np.sqrt(1.0 - ((y - 0.40) / 0.185) ** 2)
    points = np.column_stack([0.29 * ring * np.sin(angles), y, 0.14 + 0.235 * ring * np.cos(angles)])
    return groove(q, points, 0.016)
