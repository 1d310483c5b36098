"""Starts that differ by a little: how far their ends are apart shows how chaotic a scene is."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.scene.bodies import Body, velocities
from pdvol.scene.checks import count, finite, plain, require
from pdvol.scene.point_caches import TakeOver
from pdvol.scene.values import Vector


@dataclass(frozen=True)
class Jittered:
    """An initial velocity with a small random one added, the same at all points.

    Attributes
    ----------
    velocity : as `Body.velocity`
    speed : of what is added [m/s]; its direction follows from the seed
    seed : tuple of whole numbers
    """

    velocity: Vector | Callable[[np.ndarray], np.ndarray]
    speed: float
    seed: tuple[int, ...]

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(n, d) [m/s] at `points` (n, d) [m]."""
        direction = np.random.default_rng(self.seed).normal(size=points.shape[1])
        return velocities("velocity", self.velocity, points) + self.speed * direction / np.linalg.norm(direction)


def jittered(bodies: Sequence[Body], jitter: Any) -> tuple[Body, ...]:
    """The bodies, each with a velocity of its own added, of random direction.

    A velocity is added, and no displacement, so that no body meets another one at the start.

    Parameters
    ----------
    jitter : pair (speed [m/s], seed)

    Raises
    ------
    InputError
        It is no such pair.
    """
    pair = plain(jitter)
    require(isinstance(pair, tuple) and len(pair) == 2, f"jitter = {pair!r} must be (speed in m/s, seed)")
    finite("the speed of jitter", pair[0], 0.0)
    count("the seed of jitter", pair[1], 0)
    moved = []
    for number, body in enumerate(bodies):
        if isinstance(body.velocity, TakeOver):
            raise InputError(f"jitter: body {body.name!r} takes its velocity over from an animation, and keeps it")
        moved.append(replace(body, velocity=Jittered(body.velocity, float(pair[0]), (pair[1], number))))
    return tuple(moved)
