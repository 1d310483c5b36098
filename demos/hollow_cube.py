"""A ball in a hollow jelly cube that falls on an edge (paper, section 6, the limitation): where the coarse level is
solid, nothing can be inside.

`pdvol check demos/hollow_cube.py --set coarse=solid` finds that before anything runs, and names the level, both bodies
and what helps. A coarse level with a cavity of its own does, and is what runs otherwise.
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, InputError, NeoHookean, Placement, Plane, Scene, meshes
from pdvol.runs.run_metrics import motion_from_level_0

SIZE = 0.5  # m, edge of the cube
COARSE = {"solid": meshes.brick, "hollow": meshes.hollow_brick}


def scene(coarse="hollow", young=8e4, mu=0.4, height=0.25, tilt=35.0, damping=0.01, steps=120, dt=0.01):
    """The cube, `coarse` on level 0 and hollow on level 1, falls from `height` m, turned by `tilt` degrees."""
    if coarse not in COARSE:
        raise InputError(f"coarse={coarse!r}: choose one of {', '.join(COARSE)}")
    size, turn = (SIZE,) * 3, np.radians(tilt)
    middle = (0.0, height + SIZE * (np.sin(turn) + np.cos(turn)) / 2.0, 0.0)
    return Scene(
        bodies=(
            Body(
                (COARSE[coarse](size, (5, 5, 5)), meshes.hollow_brick(size, (10, 10, 10), 2)),
                NeoHookean(young, 0.4, 1000.0, damping=damping),
                name="cube",
                placement=Placement(middle, turn, (0.0, 0.0, 1.0)),
            ),
            Body(
                meshes.ball(0.09, 3),
                NeoHookean(2.0 * young, 0.4, 1000.0, damping=damping),
                (80, 300),
                name="ball",
                placement=Placement(middle),
            ),
        ),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="ground"),),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The ball stays in the cavity, and both levels come to rest on the same face."""
    away = []
    for level in run.levels:
        bodies, last = level.mesh.point_bodies, level.positions(level.steps - 1)
        away.append(np.linalg.norm(last[bodies == 1].mean(axis=0) - last[bodies == 0].mean(axis=0)))
    angles = [entry["angle_drift"] for entry in motion_from_level_0(run)[1:]]
    places, turned = ", ".join(f"{100 * x:.1f}" for x in away), ", ".join(f"{angle:.1f}" for angle in angles)
    return [
        (f"The ball ends in the cavity, {places} cm from the cube's middle on the levels.", max(away) < 0.3 * SIZE),
        (f"Level 1 has turned as level 0 has, but for {turned} degrees.", max(angles) < 30.0),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
