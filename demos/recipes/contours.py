"""Flat shapes with fine contours: what a few vertices can only draw roughly."""

import numpy as np

from pdvol.meshes import Outline
from pdvol.meshes.implicit import capsule, ellipsoid, join
from pdvol.meshes.outlines import polygon

from .field import Field


def gear(radius: float = 0.3, teeth: int = 24, tooth: float = 0.12, share: float = 0.35) -> Outline:
    """A wheel about the origin of a `radius` [m] to the feet of thin straight teeth of length `tooth` [m]; `share` is
    their width at the feet over the distance between neighbours' middles, below 1.
    """
    half = np.pi * share / teeth  # rad: half a tooth, seen from the middle
    points = []
    for middle in 2.0 * np.pi * np.arange(teeth) / teeth:
        gap = np.linspace(middle - 2.0 * np.pi / teeth + half, middle - half, 4)
        points += [(radius * np.cos(a), radius * np.sin(a)) for a in gap]
        along, across = np.array([np.cos(middle), np.sin(middle)]), np.array([-np.sin(middle), np.cos(middle)])
        foot, tip = radius * np.cos(half), radius * np.sin(half) * 0.7  # a tooth is a third narrower at its tip
        points += [tuple((foot + tooth) * along + side * tip * across) for side in (-1.0, 1.0)]
    return polygon(points)


def seahorse(height: float = 1.0, ridges: int = 22, points: int = 700) -> Outline:
    """A seahorse `height` [m] tall, looking along -x, with a curled tail, a frilled fin and `ridges` along its back;
    its lowest point is at y = 0. `points` of the outline, about.
    """
    figure = Field(0.0025, (-0.34, 0.36), (-0.06, 1.10))
    figure.values = _seahorse(figure.p, ridges)
    return figure.outline(points, height)


def _seahorse(p: np.ndarray, ridges: int) -> np.ndarray:
    spine, width = _spine()
    body = np.min([capsule(p, a, b, w) for a, b, w in zip(spine[:-1], spine[1:], width[:-1], strict=True)], axis=0)
    for part, blend in (
        (ellipsoid(p, (-0.035, 0.885), (0.098, 0.080)), 0.05),  # head
        (capsule(p, (-0.08, 0.868), (-0.235, 0.805), 0.026), 0.03),  # snout
        (capsule(p, (-0.235, 0.805), (-0.262, 0.792), 0.034), 0.015),  # mouth
        (ellipsoid(p, (-0.055, 0.56), (0.115, 0.155)), 0.06),  # belly
    ):
        body = join(body, part, blend)
    for k, (along, out) in enumerate(((-0.6, 0.055), (-0.2, 0.075), (0.25, 0.062))):  # crown
        foot = np.array([0.0, 0.95])
        body = join(
            body, capsule(p, foot, foot + out * np.array([np.sin(along), np.cos(along)]), 0.013 - 0.002 * k), 0.012
        )
    fin = ellipsoid(p, (0.155, 0.54), (0.085, 0.085))
    frills = [
        capsule(p, (0.07, 0.54), (0.07 + 0.185 * np.cos(a), 0.54 + 0.135 * np.sin(a)), 0.007)
        for a in np.linspace(-0.9, 0.9, 9)
    ]
    body = join(join(body, fin, 0.02), np.min(frills, axis=0), 0.008)
    knobs = np.linspace(0.04, 0.78, ridges) * (len(spine) - 2)
    for k in knobs.astype(int):
        along = spine[k + 1] - spine[k]
        out = np.array([-along[1], along[0]]) / np.linalg.norm(along)
        body = join(body, capsule(p, spine[k], spine[k] + (width[k] + 0.016) * out, 0.008), 0.010)
    return body


def _spine() -> tuple[np.ndarray, np.ndarray]:
    """The middle line from the neck to the tail's tip, (n, 2), and half the width there."""
    from scipy.interpolate import CubicSpline

    body = np.array(
        [[0.005, 0.88], [0.035, 0.78], [0.0, 0.66], [-0.015, 0.54], [0.02, 0.42], [0.075, 0.31], [0.085, 0.20]]
    )
    turn = np.linspace(0.0, 1.75 * np.pi, 20)[1:]
    radius = 0.150 - 0.080 * turn / turn[-1]
    curl = np.array([0.085 - 0.150, 0.20]) + radius[:, None] * np.column_stack([np.cos(turn), -np.sin(turn)])
    guide = np.vstack([body, curl])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(guide, axis=0), axis=1))])
    t = np.linspace(0.0, length[-1], 90)
    knots = np.array([0.0, 0.10, 0.25, 0.38, 0.48, 0.65, 1.0]) * length[-1]
    width = np.interp(t, knots, [0.050, 0.075, 0.085, 0.062, 0.046, 0.038, 0.024])
    return CubicSpline(length, guide)(t), width
