"""A rope falls on the ground and coils up (paper, figure "Rope drop"): at level 0 it is one element wide and kinks;
finer levels are smooth.

Which interpolant carries the motion best, and what does upsampling alone give? `benchmarks/methods.py rope_drop`
compares them.
"""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes

LENGTH, WIDTH = 2.0, 0.05  # m


def scene(young=5e4, steps=150, dt=0.01, height=0.2, mu=0.3, vertices=(100, 200, 400, 800, 1600)):
    """A rope of 2 m by 5 cm that hangs in a slight wave, its lower end `height` m above the ground."""
    return Scene(
        bodies=(
            Body(
                meshes.rope(LENGTH, WIDTH),
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="rope",
                placement=Placement(translate=(0.0, height)),
            ),
        ),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="ground"),),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
