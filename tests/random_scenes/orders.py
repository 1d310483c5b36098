"""The same scene with everything in another order, and on several ranks."""

from collections.abc import Callable
from dataclasses import replace

import cloudpickle
import numpy as np

import pdvol


def shuffled(scene: pdvol.Scene, seed: int) -> tuple[pdvol.Scene, Callable[[int, np.ndarray], np.ndarray]]:
    """The scene with its bodies, obstacles, vertices and cells in another order, and (level, positions of the new
    scene) -> those of the old one.
    """
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(scene.bodies))
    ways = [[rng.permutation(len(solid.vertices)) for solid in body.shape] for body in scene.bodies]

    def mixed(solid: pdvol.Solid, way: np.ndarray) -> pdvol.Solid:
        number = np.empty(len(way), dtype=np.int32)
        number[way] = np.arange(len(way))
        cells = rng.permutation(len(solid.cells))
        return pdvol.Solid(solid.vertices[way], number[solid.cells][cells], solid.regions[cells])

    bodies = [
        replace(body, shape=tuple(mixed(solid, way) for solid, way in zip(body.shape, ways[k], strict=True)))
        for k, body in enumerate(scene.bodies)
    ]

    def back(level: int, positions: np.ndarray) -> np.ndarray:
        sizes = [len(ways[k][level]) for k in order]
        found: list = [None] * len(order)
        for k, rows in zip(order, np.split(positions, np.cumsum(sizes)[:-1]), strict=True):
            found[k] = np.empty_like(rows)
            found[k][ways[k][level]] = rows
        return np.concatenate(found)

    obstacles = [scene.obstacles[k] for k in rng.permutation(len(scene.obstacles))]
    return replace(scene, bodies=tuple(bodies[k] for k in order), obstacles=tuple(obstacles)), back


def marched(comm, sent: bytes) -> dict[str, np.ndarray]:
    """The states by level and step; scenes have functions of their own, which cloudpickle carries over."""
    scene, how = cloudpickle.loads(sent)
    return {f"{step.level} {step.step}": step.positions for step in pdvol.march(scene, comm=comm, **how)}
