"""A soft round ball falls on a post (paper, figure "Phong Deformation"): a fine mesh bent by a few coarse cells shows
their facets.

How much of that does Phong Deformation hide, and how much remains when the fine level is simulated?
`./run python -m benchmarks.methods phong` compares them.

    pdvol run demos/phong.py --prolongation phong
"""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

RADIUS = 0.25  # m


def scene(young=2e4, steps=60, dt=0.01, height=0.6, mu=0.3, vertices=(60, 1500)):
    """A ball of radius 0.25 m, its centre `height` m above the ground and 5 cm beside the axis of a round post 0.2 m
    high.
    """
    return Scene(
        bodies=(
            Body(
                meshes.ball(RADIUS, 3),
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="ball",
                placement=Placement(translate=(0.05, height, 0.0)),
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="ground"),
            Rigid(meshes.ball(0.1, 3), name="post", placement=Placement(translate=(0.0, 0.105, 0.0))),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
