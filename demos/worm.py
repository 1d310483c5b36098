"""A worm crawls on the floor: waves of contraction run along its body, and friction does the rest.

With `--set mu=0` the same waves leave it where it is.
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, Muscle, NeoHookean, Placement, Plane, Scene, meshes

LENGTH, HEIGHT = 1.0, 0.1  # m


def scene(vertices=(100, 400), young=1e5, strength=8e4, wavelength=0.7, frequency=1.0, mu=0.6, steps=200, dt=0.01):
    """Waves of `wavelength` [m] run towards +x `frequency` times a second; muscles pull with `strength` [Pa]."""

    def wave(t, X):
        """Activation between 0 and 1, which begins within a fifth of a second."""
        phase = 2.0 * np.pi * (X[:, 0] / wavelength - frequency * t)
        return min(5.0 * t, 1.0) * np.maximum(0.0, np.sin(phase))

    worm = Body(
        meshes.rectangle(LENGTH, HEIGHT),
        NeoHookean(young, 0.45, 1000.0, damping=0.01),
        tuple(vertices),
        name="worm",
        placement=Placement(translate=(0.0, 0.5 * HEIGHT + 2e-3)),
    )
    return Scene(
        bodies=(worm,),
        muscles=(Muscle("worm", (1.0, 0.0), strength, wave),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="floor"),),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
