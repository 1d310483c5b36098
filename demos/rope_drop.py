"""A rope falls on the ground and coils up (paper, figure "Rope drop"): at level 0 it is one element wide and kinks;
finer levels are smooth.

Which interpolant carries the motion best, and what does upsampling alone give?
`./run python -m benchmarks.methods rope_drop` compares them.
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes

LENGTH, WIDTH = 2.0, 0.05  # m


def scene(young=5e4, steps=150, dt=0.01, height=0.2, mu=0.3, vertices=(100, 200, 400, 800, 1600)):
    """A rope of 2 m by 5 cm that hangs in a slight wave, its lower end `height` m above the ground."""
    return Scene(
        bodies=(
            Body(
                meshes.rope(LENGTH, WIDTH),
                NeoHookean(young, 0.4, 1000.0),
                tuple(vertices),
                name="rope",
                placement=Placement(translate=(0.0, height)),
            ),
        ),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="ground"),),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The rope lies in the same folds on all levels."""
    ends, tops = [], []
    for level in run.levels:
        x, height = level.positions(run.info["steps"]), level.rest[:, 1]
        ends.append(x[height > height.max() - WIDTH / 2].mean(axis=0))
        tops.append(x[:, 1].max())
    apart, shown = float(np.linalg.norm(np.array(ends) - ends[0], axis=1).max()), ", ".join(f"{y:.3f}" for y in tops)
    places = ", ".join(f"({x:.2f}, {y:.2f})" for x, y in ends)
    return [
        (f"The rope of {LENGTH:.0f} m lies in folds, {shown} m high on the levels.", max(tops) < 0.2 * LENGTH),
        (f"Its upper end comes to the same place: {places} m.", ends[0][0] < -4 * WIDTH),
        (f"These places are within {100 * apart:.1f} cm; the rope is {100 * WIDTH:.0f} cm wide.", apart < WIDTH),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
