"""A soft ball dropped on a sharp spike, slightly off-centre (paper, figures 2 and 10).

Which way does it fall? Levels simulated on their own fall to different sides. Progressively refined levels fall to the
same side.
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

RADIUS = 0.25  # m
TIP = 0.5  # m, height of the spike


def scene(offset=0.002, young=3e4, steps=120, dt=0.01, height=0.9, mu=0.3):
    """A ball of radius 0.25 m; its centre starts `offset` m beside the spike's axis and `height` m above the ground."""
    return Scene(
        bodies=(
            Body(
                meshes.disc(RADIUS),
                NeoHookean(young, 0.4, 1000.0),
                vertices=(60, 130, 310, 570, 1100),
                name="ball",
                placement=Placement(translate=(offset, height)),
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0), (0.0, 1.0), name="ground"),
            Rigid(meshes.spike(width=0.24, height=TIP), name="spike", placement=Placement(translate=(0.0, 0.002))),
        ),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """All levels fall to the same side."""
    ends = np.array([level.positions(run.info["steps"])[:, 0].mean() for level in run.levels])
    places = ", ".join(f"{end:+.3f}" for end in ends)
    sentence = f"The ball ends on the same side of the spike on all levels: {places} m sideways"
    apart = np.ptp(ends)
    return [
        (f"{sentence}.", bool(abs(np.sign(ends).sum()) == len(ends)) and abs(ends).min() > RADIUS),
        (f"These places are {apart:.3f} m apart at most, less than a fifth of the radius.", apart < 0.2 * RADIUS),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
