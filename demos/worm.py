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


def claim(run):
    """The worm crawls against the waves, as far on all levels."""
    steps, levels = run.info["steps"], run.levels
    ways = [float(_centre(level, steps) - _centre(level, 0)) for level in levels]  # m
    apart, shown = max(ways) - min(ways), ", ".join(f"{way:+.3f}" for way in ways)
    return [
        (f"Against the waves, which run to +x: the worm crawls by {shown} m on the levels.", max(ways) < -0.03),
        (f"These ways are within {1000 * apart:.1f} mm.", apart < 0.1 * -min(ways)),
    ]


def _centre(level, step):
    """Where along the floor the centre of mass is [m]."""
    return level.mesh.volumes @ level.positions(step)[level.cells, 0].mean(axis=1) / level.mesh.volumes.sum()


if __name__ == "__main__":
    pdvol.main(scene)
