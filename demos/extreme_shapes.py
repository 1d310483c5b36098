"""A gear with thin teeth and a seahorse fall over pegs (paper, figure "extreme coarse shapes"): level 0 has about 70
vertices a body, the finest level more than 50 times as many.

Do both come to rest where level 0 puts them, although its outline has little of their teeth and knobs?
"""

import numpy as np

import pdvol
import recipes
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes
from pdvol.runs.run_metrics import motion_from_level_0

PEG = 0.09  # m, radius of a peg
PEGS = ((-0.75, 0.55), (-0.10, 0.62), (0.55, 0.55), (-0.42, 0.12), (0.22, 0.12))  # m, their middles


def scene(vertices=(65, 260, 950, 3500), young=8e4, mu=0.4, damping=0.02, height=0.95, steps=200, dt=0.01):
    """Both fall from `height` m onto five pegs above the ground; `damping` [s] lets them come to rest."""
    material = NeoHookean(young, 0.4, 1000.0, damping=damping)

    def falling(name, shape, x, y, degrees):
        return Body(shape, material, tuple(vertices), name=name, placement=Placement((x, y), np.radians(degrees)))

    return Scene(
        bodies=(
            falling("gear", recipes.gear(0.2, 20, 0.08), -0.44, height + 0.2, 4.0),
            falling("seahorse", recipes.seahorse(0.75), 0.36, height - 0.1, -20.0),
        ),
        obstacles=(
            Plane((0.0, 0.0), (0.0, 1.0), name="ground"),
            *(
                Rigid(meshes.disc(PEG, 48), name=f"peg {k + 1}", placement=Placement(place))
                for k, place in enumerate(PEGS)
            ),
        ),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """Both come to rest where level 0 puts them: on the same pegs, in the same pose."""
    size = 0.56  # m, the gear's diameter; the seahorse is larger
    found = motion_from_level_0(run)[1:]
    places, angles = ([entry[key] for entry in found] for key in ("centre_drift", "angle_drift"))
    sentence = f"Bodies of finer levels end at most {', '.join(f'{100 * x:.1f}' for x in places)} cm and"
    sentence += (
        f" {', '.join(f'{angle:.1f}' for angle in angles)} degrees from level 0, less than a fifth of the gear's"
    )
    few, many = len(run.levels[0].rest), len(run.levels[-1].rest)
    return [
        (f"{sentence} diameter and 20 degrees.", max(places) < 0.2 * size and max(angles) < 20.0),
        (f"The finest level has {many / few:.0f} times the vertices of level 0.", many > few),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
