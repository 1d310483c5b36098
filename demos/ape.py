"""A soft gorilla, held by its seat, its feet and one fist, is thrown upward with force (paper, "Large deformation").

A level simulated on its own drifts away from level 0 after a while. Progressively refined levels swing as level 0 does:

    pdvol run demos/ape.py                                                 # runs/ape
    pdvol run demos/ape.py --method direct --out runs/ape_direct
    ./run python -m benchmarks.divergence runs/ape_direct runs/ape -o divergence.png
"""

import numpy as np

import pdvol
import recipes
from pdvol import Barrier, Body, Impulse, NeoHookean, Placement, Scene, Support
from pdvol.runs.run_metrics import motion_from_level_0

HEIGHT = 1.0  # m, along z
HELD = 0.03  # m above the ground: seat, soles and the right fist


def scene(vertices=(300, 700, 1600, 3600), young=2e4, speed=5.0, steps=800, dt=0.01):
    """The gorilla, 1 m tall along z, suddenly gets an upward velocity of `speed` m/s; nothing else acts on it."""
    return Scene(
        bodies=(
            Body(
                recipes.ape(),
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="ape",
                placement=Placement(angle=np.pi / 2, axis=(1.0, 0.0, 0.0)),
            ),
        ),
        supports=(Support(lambda X: X[:, 2] < HELD),),
        loads=(Impulse((0.0, 0.0, speed)),),
        contact=(Barrier(),),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """All levels swing as level 0 does, to the end."""
    found = motion_from_level_0(run)[1:]
    most, end = ([entry[key] for entry in found] for key in ("largest_distance", "distance"))
    shown, last = (", ".join(f"{1000 * x:.0f}" for x in distances) for distances in (most, end))
    sentence = (
        f"Finer levels are at most {shown} mm from level 0, a mean over the gorilla, in any step ({last} mm at the"
    )
    return [(f"{sentence} end); it is {HEIGHT:g} m tall.", max(most) < 0.05 * HEIGHT)]


if __name__ == "__main__":
    pdvol.main(scene)
