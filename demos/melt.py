"""A tower of jelly softens until it slumps, and stands up again when it sets: its Young's modulus follows keys."""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, Keyed, NeoHookean, Placement, Plane, Scene, meshes

WIDTH, HEIGHT = 0.3, 0.4  # m


def scene(vertices=(60, 240), young=1e5, melted=4e3, mu=0.5, steps=150, dt=0.01):
    """`young` [Pa] falls to `melted` from 0.2 to 0.5 s, and rises again from 0.9 to 1.1 s."""
    tower = Body(
        meshes.rectangle(WIDTH, HEIGHT),
        NeoHookean(Keyed((0.2, 0.5, 0.9, 1.1), (young, melted, melted, young)), 0.45, 1000.0, damping=0.02),
        tuple(vertices),
        name="tower",
        placement=Placement(translate=(0.0, 0.5 * HEIGHT + 2e-3)),
    )
    return Scene(
        bodies=(tower,),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="floor"),),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(stiffness=3.0), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The tower slumps and stands up again, alike on all levels."""
    heights = np.array([[x.positions(s)[:, 1].max() for s in range(x.steps)] for x in run.levels])  # m
    apart, lowest, last = float(np.ptp(heights, axis=0).max()), heights.min(axis=1), heights[:, -1]
    return [
        (f"The tower of {HEIGHT} m slumps to {_list(lowest)} m on the levels.", bool((lowest < 0.33).all())),
        (f"At the end it is {_list(last)} m high again.", bool((last > 0.38).all())),
        (f"At every moment its heights on the levels are within {1000 * apart:.1f} mm.", apart < 0.01),
    ]


def _list(values):
    return ", ".join(f"{value:.3f}" for value in values)


if __name__ == "__main__":
    pdvol.main(scene)
