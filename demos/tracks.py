"""Two levels of the slit array (paper, figure "TRACKS"): an independent fine simulation that springs pull towards the
coarse one.

Which follows the preview better: springs, whose strength must be chosen, or the coarse velocity?
`./run python -m benchmarks.methods tracks` compares them.

    pdvol run demos/tracks.py --method tracks --set weight=0.01
"""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes


def scene(young=1e5, steps=150, dt=0.01, height=0.3, angle=0.1, mu=0.3, vertices=(100, 770)):
    """A block of 0.9 m by 1 m, cut into seven strips, `height` m above the ground and turned by `angle` rad."""
    return Scene(
        bodies=(
            Body(
                meshes.slit_array(),
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="slits",
                placement=Placement(translate=(0.0, height), angle=angle),
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
