"""Two leaf sheep on a sea mushroom (paper, figure 1): a current sweeps them off their caps, they meet over a stone and
come to rest on their feet.

Level 0 answers in minutes; is the night's run of level 2 the same story?
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Flow, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, Support, meshes

LENGTH = 0.36  # m, of a leaf sheep
HEIGHT = 0.6  # m, of the plant
WEIGHT = 3.0  # m/s^2, gravity less buoyancy
CAPS = ((-0.24, 0.632, 0.0), (0.24, 0.560, 0.03))  # m, the middles of the two upper caps, on top


def scene(
    vertices=((1250, 8000, 38000), (650, 2500, 11000)),
    young=4e4,
    current=0.55,
    until=0.8,
    turns=(65.0, -75.0),
    stone=(0.0, 0.42),
    mu=0.3,
    damping=0.03,
    steps=180,
    dt=0.02,
):
    """A current of `current` m/s flows towards the stone, from both sides and from behind, `until` that time [s].

    `vertices` of a leaf sheep and of the plant by level; `turns` [degrees] is where their heads point, from +z; `stone`
    is its place (x, z) [m].
    """
    sheep, plant = vertices
    middle = np.array([stone[0], 0.3, stone[1]])

    def flow(x, t):
        way = middle - x
        way[:, 1] = 0.05
        pulse = np.sin(np.pi * min(t / until, 1.0)) ** 2
        return current * pulse * way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 0.2)

    flesh = NeoHookean(young, 0.4, 1000.0, damping=damping)
    return Scene(
        bodies=(
            *(
                Body(
                    meshes.leaf_sheep(LENGTH, 24000),
                    flesh,
                    tuple(sheep),
                    name=f"sheep {k + 1}",
                    placement=Placement((x, y, z), np.radians(turn), (0.0, 1.0, 0.0)),
                )
                for k, ((x, y, z), turn) in enumerate(zip(CAPS, turns, strict=True))
            ),
            Body(
                meshes.sea_mushroom(HEIGHT, 6000),
                NeoHookean(12.0 * young, 0.4, 1000.0, damping=damping),
                tuple(plant),
                name="plant",
                placement=Placement((0.0, 0.005, 0.0)),
            ),
        ),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="sea floor"),
            Rigid(meshes.stone(0.34, 1200), name="stone", placement=Placement((stone[0], 0.001, stone[1]))),
        ),
        supports=(Support(lambda X: X[:, 1] < 0.02, body="plant"),),
        loads=(Gravity((0.0, -WEIGHT, 0.0)), Flow(flow, 1000.0, 0.25)),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
