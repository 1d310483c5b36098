"""A small scene that tests run from memory: a soft square, two levels, falls on the ground."""

import numpy as np

from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene
from shapes import solid


def scene(levels: int = 2, steps: int = 4, young: float = 1e4) -> Scene:
    """The square, 5 mm above the ground."""
    shapes = tuple(solid(2, 2 * 2**level) for level in range(levels))
    return Scene(
        bodies=(Body(shapes, NeoHookean(young), name="square", placement=Placement(np.array([0.0, 0.005]))),),
        loads=(Gravity(np.array([0.0, -9.81])),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="ground"),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.02,
        steps=steps,
        name="square",
    )
