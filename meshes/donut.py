"""A glazed donut: its dough as a closed surface to simulate, and its glaze and dough as a surface to look at, with the
picture that is its texture.

The middle of the tube lies on a circle in the plane y = 0. Places in the texture are the two angles, from 0 to 1: along
the ring, and around the tube from its outer side upward.
"""

import numpy as np

from .geometry import RenderSurface, Surface
from .turned import torus

GLAZE = 0.06
"""Thickness of the glaze, relative to the tube's radius."""
RIM = 0.05
"""How wide the rim of the glaze is, in radians around the tube."""


def donut(radius: float = 0.3, tube: float = 0.13, segments: int = 48, around: int = 24) -> Surface:
    """The dough [m]: a torus about the y axis. `radius`, `tube`, `segments` and `around` are those of `torus`."""
    return torus(radius, tube, segments, around)


def donut_render(radius: float = 0.3, tube: float = 0.13, segments: int = 256, around: int = 128) -> RenderSurface:
    """The same donut in detail: quadrilaterals, glaze on its upper side, and seams where the angles begin again.

    `radius`, `tube`, `segments` and `around` are those of `torus`.
    """
    along, turn = np.arange(segments) / segments, np.arange(around) / around
    a, b = (2.0 * np.pi * v.ravel() for v in np.meshgrid(along, turn, indexing="ij"))
    r = tube * (1.0 + GLAZE * _glazed(a, b))
    reach = radius + r * np.cos(b)
    vertices = np.column_stack([reach * np.cos(a), r * np.sin(b), reach * np.sin(a)])
    i, j = (v.ravel() for v in np.meshgrid(np.arange(segments), np.arange(around), indexing="ij"))
    ends = ((i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j))
    faces = np.column_stack([(p % segments) * around + q % around for p, q in ends])
    # One more row and column of places than of vertices: the texture has two borders that meet.
    places = np.column_stack(
        [
            v.ravel()
            for v in np.meshgrid(np.arange(segments + 1) / segments, np.arange(around + 1) / around, indexing="ij")
        ]
    )
    return RenderSurface.of(vertices, faces, places, np.column_stack([p * (around + 1) + q for p, q in ends]))


def donut_texture(width: int = 1024, height: int = 512, sprinkles: int = 170, seed: int = 1) -> np.ndarray:
    """Its texture (height, width, 3) uint8, the top row first: dough with a pale ring, pink glaze, sprinkles.

    Parameters
    ----------
    width, height : of the picture [pixels]
    sprinkles : how many
    seed : of their places
    """
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, 1.0 - (np.arange(height) + 0.5) / height)
    a, b = 2.0 * np.pi * u, 2.0 * np.pi * v
    glaze = _glazed(a, b)[..., None]
    grain = 1.0 + 0.03 * np.sin(61.0 * a + 5.0 * np.sin(7.0 * b)) * np.sin(23.0 * b + 3.0 * np.sin(5.0 * a))
    # Where dough swims it stays pale: around both sides at the height of the middle.
    pale = np.exp(-((np.sin(b) + 0.12) ** 2) / 0.02)[..., None]
    dough = (1.0 - pale) * np.array([0.72, 0.43, 0.19]) + pale * np.array([0.95, 0.80, 0.56])
    image = (1.0 - glaze) * dough * grain[..., None] + glaze * np.array([0.93, 0.45, 0.62])
    rng = np.random.default_rng(seed)
    colours = np.array(
        [[0.98, 0.93, 0.36], [0.35, 0.72, 0.88], [0.98, 0.98, 0.96], [0.52, 0.80, 0.40], [0.90, 0.22, 0.25]]
    )
    for k in range(sprinkles):
        middle, turn = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.75, 2.4)
        angle, colour = rng.uniform(0.0, np.pi), colours[k % len(colours)]
        # In units of the tube's radius, with the ring's middle circle 2.3 of them from the axis.
        across = (np.mod(a - middle + np.pi, 2.0 * np.pi) - np.pi) * (2.3 + np.cos(turn)), b - turn
        lengthwise = across[0] * np.cos(angle) + across[1] * np.sin(angle)
        sideways = -across[0] * np.sin(angle) + across[1] * np.cos(angle)
        inside = np.hypot(np.maximum(np.abs(lengthwise) - 0.07, 0.0), sideways) < 0.028
        image[inside & (glaze[..., 0] > 0.9)] = colour
    return np.round(255.0 * np.clip(image, 0.0, 1.0)).astype(np.uint8)


def _glazed(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """1 where there is glaze, 0 elsewhere, at angles along the ring and around the tube: on top, to a wavy rim."""
    edge = 0.12 + 0.13 * np.sin(7.0 * a) + 0.08 * np.sin(11.0 * a + 1.0) + 0.05 * np.sin(17.0 * a + 2.0)
    inner = np.pi - 0.05 - 0.12 * np.sin(5.0 * a + 0.5) - 0.07 * np.sin(9.0 * a + 2.0)
    step = lambda x: 0.5 * (1.0 + np.tanh(x / RIM))
    angle = np.mod(b + 0.5 * np.pi, 2.0 * np.pi) - 0.5 * np.pi
    return step(angle - edge) * step(inner - angle)
