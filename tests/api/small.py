"""A small scene that tests run from memory: a soft square, two levels, falls on the ground."""

import numpy as np

from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, Solid


def square(cells: int) -> Solid:
    """A unit square of 2 cells**2 triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, cells + 1), np.linspace(0, 1, cells + 1), indexing="ij")
    corner = np.arange(cells * (cells + 1)).reshape(cells, cells + 1)[:, :-1].ravel()
    a, b, c, d = corner, corner + cells + 1, corner + cells + 2, corner + 1
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return Solid(np.column_stack([x.ravel(), y.ravel()]), triangles, np.zeros(len(triangles), np.int32))


def scene(levels: int = 2, steps: int = 4, young: float = 1e4) -> Scene:
    """The square, 5 mm above the ground."""
    shapes = tuple(square(2 * 2**level) for level in range(levels))
    return Scene(
        bodies=(Body(shapes, NeoHookean(young), name="square", placement=Placement(np.array([0.0, 0.005]))),),
        loads=(Gravity(np.array([0.0, -9.81])),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="ground"),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.02,
        steps=steps,
        name="square",
    )
