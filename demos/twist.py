"""A bar whose ends are turned in opposite directions, then one is released (paper, section "Twisting behaviour").

    pdvol run demos/twist.py --levels 0:1

Four levels of 3,700, 9,126, 32,000 and 107,100 vertices; `--levels 0:1` is a quick look; all four took 20 minutes on
one shared core.
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, NeoHookean, Rotation, Scene, Support, meshes
from pdvol.runs.run_metrics import motion_from_level_0

LENGTH, WIDTH = 1.0, 0.25  # m
CUTS = ((36, 9), (53, 12), (79, 19), (118, 29))  # boxes along and across the bar, per level
END = 1e-6  # m within which a vertex belongs to an end face


def scene(cuts=CUTS, speed=300.0, release=0.7, young=2e5, poisson=0.4, steps=100, dt=0.01):
    """The ends turn at `speed` deg/s in opposite directions until `release` [s], when the end at +x is released; the
    other one then stays.
    """
    turns = [Rotation(sign * np.radians(speed), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), stop=release) for sign in (1, -1)]
    return Scene(
        bodies=(
            Body(
                tuple(meshes.brick((LENGTH, WIDTH, WIDTH), (along, across, across)) for along, across in cuts),
                NeoHookean(young, poisson, 1000.0),
                name="bar",
            ),
        ),
        supports=(
            Support(lambda X: X[:, 0] < -LENGTH / 2 + END, motion=turns[0]),
            Support(lambda X: X[:, 0] > LENGTH / 2 - END, motion=turns[1], release=release),
        ),
        contact=(Barrier(),),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """After the release the bar untwists alike on all levels."""
    found = motion_from_level_0(run)[1:]
    most, end = ([entry[key] for entry in found] for key in ("largest_distance", "distance"))
    shown, last = (", ".join(f"{1000 * x:.1f}" for x in distances) for distances in (most, end))
    sentence = (
        f"Finer levels are at most {shown} mm from level 0, a mean over the bar, in any step ({last} mm at the end)"
    )
    return [(f"{sentence}; the bar is {1000 * WIDTH:.0f} mm wide.", max(most) < 0.1 * WIDTH)]


if __name__ == "__main__":
    pdvol.main(scene)
