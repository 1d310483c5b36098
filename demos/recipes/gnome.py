"""A gnome with a beard and a pointed hat, and a toy block with letters cut into its faces."""

from functools import lru_cache

import numpy as np

from pdvol.meshes import Surface
from pdvol.meshes.implicit import capsule, cone, contoured, ellipsoid, join

from .field import Field


@lru_cache(maxsize=4)  # seconds to make
def gnome(height: float = 0.6, vertices: int = 6000) -> Surface:
    """A standing gnome `height` [m] tall to the tip of its hat, y up, facing +z, its soles at y = 0.

    `vertices` of the surface, about.
    """
    figure = Field(0.011, (-0.40, 0.40), (-0.05, 1.08), (-0.34, 0.40))
    p, q = figure.p, figure.q
    parts = [
        (ellipsoid(p, (0.0, 0.30, 0.0), (0.185, 0.215, 0.165)), 0.05),  # belly
        (ellipsoid(p, (0.0, 0.545, 0.015), (0.130, 0.125, 0.125)), 0.05),  # head
        (capsule(q, (0.085, 0.14, 0.0), (0.095, 0.065, 0.015), 0.072), 0.03),  # legs
        (ellipsoid(q, (0.105, 0.045, 0.070), (0.078, 0.052, 0.125)), 0.03),  # shoes
        (capsule(q, (0.165, 0.415, 0.0), (0.285, 0.285, 0.060), 0.050), 0.035),  # arms
        (ellipsoid(q, (0.300, 0.262, 0.072), (0.056, 0.056, 0.056)), 0.02),  # hands
        (ellipsoid(p, (0.0, 0.545, 0.155), (0.040, 0.036, 0.042)), 0.010),  # nose
        (ellipsoid(q, (0.135, 0.545, 0.0), (0.034, 0.045, 0.030)), 0.012),  # ears
        (ellipsoid(p, (0.0, 0.440, 0.112), (0.115, 0.105, 0.062)), 0.015),  # beard
        (cone(p, (0.0, 0.415, 0.125), (0.0, 0.235, 0.185), 0.085, 0.018), 0.020),
        (capsule(q, (0.015, 0.508, 0.158), (0.095, 0.478, 0.128), 0.026), 0.010),  # moustache
        (ellipsoid(p, (0.0, 0.645, 0.005), (0.205, 0.032, 0.195)), 0.015),  # brim of the hat
        (cone(p, (0.0, 0.650, 0.005), (0.0, 0.840, -0.015), 0.138, 0.075), 0.025),
        (cone(p, (0.0, 0.840, -0.015), (0.035, 1.005, -0.065), 0.075, 0.022), 0.015),
    ]
    return figure.join(parts).surface(vertices, 1, height)


@lru_cache(maxsize=4)
def letter_block(size: float = 0.4, depth: float = 0.10, vertices: int = 4000) -> Surface:
    """A toy block with edges of `size` [m] about the origin, with A, B and C cut into its faces: A above, B before (+z)
    and behind, C on the sides. `depth` of the letters, over the size; `vertices` of the surface, about.
    """
    h = 0.0125  # grid cell of a block of size one
    axis = np.arange(-0.54, 0.54, h)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij", sparse=True)  # a letter depends on two of them
    away = np.stack(np.broadcast_arrays(*(np.abs(c) - (0.5 - 0.05) for c in (x, y, z))), axis=-1)
    block = np.linalg.norm(np.maximum(away, 0.0), axis=-1) + np.minimum(away.max(axis=-1), 0.0) - 0.05
    faces = (
        ("A", x, -z, 0.5 - y),
        ("B", x, y, 0.5 - z),
        ("B", -x, y, 0.5 + z),
        ("C", -z, y, 0.5 - x),
        ("C", z, y, 0.5 + x),
    )
    for letter, right, up, below in faces:
        stroke = _letter(letter, np.stack(np.broadcast_arrays(right, up), axis=-1)) - 0.058
        block = -join(-block, np.maximum(stroke, below - depth), 0.015)
    points, triangles = contoured(block, [axis, axis, axis], h, vertices)
    middle = (points.max(axis=0) + points.min(axis=0)) / 2.0
    scale = size / np.ptp(points, axis=0).max()
    return Surface((points - middle) * scale, np.ascontiguousarray(triangles, dtype=np.int32))


def _letter(name: str, p: np.ndarray) -> np.ndarray:
    """Distance to the strokes of a letter 0.6 tall about the origin."""
    top, low = 0.30, -0.30
    if name == "A":
        lines = [((-0.23, low), (0.0, top)), ((0.23, low), (0.0, top)), ((-0.15, -0.10), (0.15, -0.10))]
    elif name == "B":
        lines = [((-0.15, low), (-0.15, top)), *_arc((0.0, 0.15), 0.15, -90, 90), *_arc((0.03, -0.15), 0.15, -90, 90)]
        lines += [((-0.15, y), (0.03, y)) for y in (low, 0.0, top)]
    else:
        lines = _arc((0.03, 0.0), 0.28, 50, 310)
    return np.min([capsule(p, a, b, 0.0) for a, b in lines], axis=0)


def _arc(centre: tuple[float, float], radius: float, start: float, end: float) -> list:
    """Chords of an arc from `start` to `end` [degrees]."""
    angle = np.radians(np.linspace(start, end, 15))
    points = np.asarray(centre) + radius * np.column_stack([np.cos(angle), np.sin(angle)])
    return list(zip(points[:-1], points[1:], strict=True))
