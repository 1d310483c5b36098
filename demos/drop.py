"""A soft shape falls spinning on two round stones and the floor: a surface file, or pdvol's bear cub.

pdvol run demos/drop.py --set surface=cow.obj
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes
from pdvol.meshing.readers import read_shape
from pdvol.runs.run_metrics import motion_from_level_0

SIZE = 1.0  # m: the largest extent that any shape is scaled to, y up


def scene(surface="", vertices=(500, 2000, 8000), young=1e5, mu=0.3, spin=2.0, steps=100, dt=0.01, height=1.0):
    """The shape's centre starts `height` m above the floor, turning at `spin` rad/s; two stones lie below."""
    shape = read_shape(surface) if surface else meshes.creature(height=SIZE)
    low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
    scale = SIZE / np.max(high - low)
    centre = scale * (low + high) / 2
    stones = [((-0.34, 0.2, 0.05), 0.2), ((0.30, 0.14, -0.08), 0.14)]
    return Scene(
        bodies=(
            Body(
                shape,
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="drop",
                spin=(0.4 * spin, 0.2 * spin, spin),
                placement=Placement(translate=(-centre[0], height - centre[1], -centre[2]), scale=scale),
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),
            *(
                Rigid(
                    meshes.ball(radius, 3),
                    name=f"stone {i + 1}",
                    placement=Placement(translate=(place[0], place[1] + 0.01, place[2])),
                )
                for i, (place, radius) in enumerate(stones)
            ),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The shape lies where level 0 puts it, and as level 0 turns it."""
    found = motion_from_level_0(run)[1:]
    places, angles = ([entry[key] for entry in found] for key in ("centre_drift", "angle_drift"))
    sentence = f"Finer levels end {', '.join(f'{1000 * x:.0f}' for x in places)} mm and"
    sentence += (
        f" {', '.join(f'{angle:.1f}' for angle in angles)} degrees from level 0, less than a twentieth of its size"
    )
    return [(f"{sentence} and 10 degrees.", max(places) < 0.05 * SIZE and max(angles) < 10.0)]


if __name__ == "__main__":
    pdvol.main(scene)
