"""A soft cube of 0.2 m slides down a slope of 20 degrees with friction of 0.2, and so gains 1.5 m/s^2."""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes

SIDE = 0.2  # m
ANGLE = np.radians(20.0)


def scene(cuts=(2, 4, 8), young=1e5, mu=0.2, steps=100, dt=0.01):
    """The slope is level here, and gravity is tilted."""
    return Scene(
        bodies=(
            Body(
                tuple(meshes.brick((SIDE, SIDE, SIDE), (n, n, n)) for n in cuts),
                NeoHookean(young, 0.4, 1000.0),
                name="cube",
                placement=Placement(translate=(0.0, 0.0, SIDE / 2 + 4e-4)),
            ),
        ),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="slope"),),
        loads=(Gravity((9.81 * np.sin(ANGLE), 0.0, -9.81 * np.cos(ANGLE))),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
