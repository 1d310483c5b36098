"""A soft dolphin falls across a bar (paper, figure "Phong Deformation"): a fine mesh bent by a few coarse cells shows
their facets.

How much of that does Phong Deformation hide, and how much remains when the fine level is simulated?
`./run python -m benchmarks.methods phong` compares them.

    pdvol run demos/phong.py --prolongation phong
"""

import numpy as np

import pdvol
import recipes
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

LENGTH, BAR = 1.0, 0.4  # m: of the dolphin, and the height of the bar's axis


def scene(young=1e4, steps=60, dt=0.01, height=0.75, mu=0.3, vertices=(60, 5000)):
    """A dolphin 1 m long, `height` m above the ground, across a round bar 0.2 m thick."""
    return Scene(
        bodies=(
            Body(
                recipes.dolphin(LENGTH),
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="dolphin",
                placement=Placement((0.0, height, 0.0), -2.0 * np.pi / 3.0, (1.0, 1.0, 1.0)),
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="ground"),
            Rigid(
                meshes.cylinder(0.1, 0.6, 48),
                name="bar",
                placement=Placement((0.0, BAR, 0.0), np.pi / 2.0, (1.0, 0.0, 0.0)),
            ),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
