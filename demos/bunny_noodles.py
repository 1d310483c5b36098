"""Forty bunny-shaped slices, thin as noodles, fall into a bowl (paper, figure "bunny noodles"): on level 0 they are one
element thick.

Does the pile have the same order from below to above on all levels, and do its folds get sharper?
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes

HEIGHT, THICKNESS = 0.24, 0.008  # m, of a slice
RADIUS, DEPTH = 0.32, 0.20  # m, inside the bowl
SPACING = 0.025  # m, from slice to slice at the start


def scene(slices=40, vertices=(60, 260, 1060), young=2e4, mu=0.3, damping=0.02, seed=1, steps=150, dt=0.01):
    """The `slices`, stacked in the air and turned at random by `seed`, fall one after the other."""
    random = np.random.default_rng(seed)
    noodle = Body(
        meshes.bunny_slice(HEIGHT, THICKNESS, 160),
        NeoHookean(young, 0.35, 1000.0, damping=damping),
        tuple(vertices),
        name="slice",
    )
    places = []
    for k in range(slices):
        x, z = random.uniform(-0.05, 0.05, 2)
        places.append(Placement((x, DEPTH + 0.06 + SPACING * k, z), random.uniform(0.0, 2.0 * np.pi), (0.0, 1.0, 0.0)))
    return Scene(
        bodies=noodle.instances(*places),
        obstacles=(
            Plane((0.0, -0.03, 0.0), (0.0, 1.0, 0.0), name="table"),
            Rigid(meshes.bowl(RADIUS, DEPTH, 0.02), name="bowl", opacity=0.35),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def heights(run, level):
    """Of the middles of the slices at the end [m]."""
    bodies, last = run.levels[level].mesh.point_bodies, run.levels[level].positions(run.levels[level].steps - 1)
    return np.bincount(bodies, last[:, 1]) / np.bincount(bodies)


def claim(run):
    """The pile keeps its order on all levels. A slice is above another where it is higher by more than a thickness."""
    first = heights(run, 0)
    apart = np.subtract.outer(first, first)
    above = apart > THICKNESS
    found = []
    for level in range(1, len(run.levels)):
        now = heights(run, level)
        kept = np.subtract.outer(now, now) > 0.0
        among, of_all = float(kept[above].mean()), float(kept[apart > 0.0].mean())
        found.append(
            (
                f"Of {above.sum()} pairs of slices of which one is higher by more than a thickness on level 0,"
                f" {100 * among:.1f} % have the same order on level {level}; of all pairs {100 * of_all:.1f} %.",
                among > 0.95,
            )
        )
    return found


if __name__ == "__main__":
    pdvol.main(scene)
