"""Five soft cubes of 0.2 m dropped on each other from 2 cm gaps; the tower stands."""

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes

SIDE = 0.2  # m
GAP = 0.02  # m


def scene(cuts=(2, 4), count=5, young=1e5, mu=0.4, steps=100, dt=0.01):
    """Each cube is turned a little against the one below."""
    return Scene(
        bodies=tuple(
            Body(
                tuple(meshes.brick((SIDE, SIDE, SIDE), (n, n, n)) for n in cuts),
                NeoHookean(young, 0.4, 1000.0),
                name=f"cube {i + 1}",
                placement=Placement(translate=(0.0, 0.0, SIDE / 2 + GAP + i * (SIDE + GAP)), angle=0.3 * i),
            )
            for i in range(count)
        ),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="floor"),),
        loads=(Gravity((0.0, 0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
