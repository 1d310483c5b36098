"""A tower of jelly softens until it slumps, and stands up again when it sets: its Young's modulus follows keys."""

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


if __name__ == "__main__":
    pdvol.main(scene)
