"""A block of slits falls on the ground (paper, figures "consistency weights"): soft strips, eight levels and a large
time step.

How far do the levels drift apart, and which weight of the penalty holds them together?
`./run python -m benchmarks.methods slit_array` varies the weight.

    pdvol run demos/slit_array.py --set consistency=0.025
"""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes
from pdvol.runs.run_metrics import motion_from_level_0

LEVELS = (100, 130, 170, 230, 310, 420, 570, 770)


def scene(young=1e5, steps=150, dt=0.04, height=0.3, angle=0.1, mu=0.3, vertices=LEVELS):
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


def claim(run):
    """Eight levels do not drift apart: the finest one ends where level 0 does."""
    last = motion_from_level_0(run)[-1]
    centre, angle = last["centre_drift"], last["angle_drift"]
    return [
        (
            f"Level {last['level']} ends {1000 * centre:.0f} mm and {angle:.1f} degrees from level 0, less than a tenth"
            f" of the block's height and 10 degrees.",
            centre < 0.1 and angle < 10.0,
        )
    ]


if __name__ == "__main__":
    pdvol.main(scene)
