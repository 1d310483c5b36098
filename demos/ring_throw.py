"""A soft bear, swung by its feet, is thrown through a ring, and has to end sitting upright on a step behind it.

Few throws do. A search finds one on level 0:

    pdvol wedge demos/ring_throw.py --seek through_and_sits --vary speed=3:7 --vary angle=20:75 --vary aim=-15:15 \\
        --vary spin=-12:12 --runs 300 -o throws
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes
from pdvol.explore.wedge.scores import lands_in, quiet, upright

SIZE = 0.5  # m, the bear's height
START = np.array([0.0, 0.6, 0.0])  # m, where the middle of the bear is thrown from, head down
RING = np.array([1.1, 1.4, 0.0])  # m, the ring's middle; its axis is x
HOLE, TUBE = 0.36, 0.05  # m, radii of the ring's hole and tube
LOWER, UPPER = np.array([1.6, 0.0, -0.5]), np.array([2.8, 0.9, 0.5])  # m, corners of the step
MARGIN = 0.03  # m, what is left between bear and ring, at least
GOOD = 0.9  # through_and_sits from here on: nothing touched, on the step, at most 26 degrees from upright, at rest


def scene(
    speed=5.0, angle=55.0, aim=0.0, spin=0.0, vertices=(150, 400, 1000), young=1e5, damping=0.02, mu=0.8, steps=75, dt=0.02
):
    """The bear is thrown at `speed` m/s, `angle` degrees above the ground and `aim` degrees to the side, turning at
    `spin` rad/s about the axis across the throw.
    """
    up, side = np.radians([angle, aim])
    direction = np.array([np.cos(up) * np.cos(side), np.sin(up), np.cos(up) * np.sin(side)])
    bear = Body(
        meshes.creature(),
        NeoHookean(young, 0.4, 1000.0, damping=damping),
        tuple(vertices),
        name="bear",
        velocity=tuple(speed * direction),
        spin=(0.0, 0.0, spin),
        placement=Placement(translate=tuple(START + [0.0, SIZE / 2, 0.0]), angle=np.pi, scale=SIZE),
    )
    across = Placement(translate=tuple(RING), angle=np.pi / 2)
    middle = Placement(translate=tuple((LOWER + UPPER) / 2 + [0.0, 0.001, 0.0]))
    return Scene(
        bodies=(bear,),
        obstacles=(
            Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor"),
            Rigid(meshes.torus(HOLE + TUBE, TUBE, segments=32), name="ring", placement=across),
            Rigid(meshes.box(UPPER - LOWER, 4), name="step", placement=middle),
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def clearance(run):
    """What the ring leaves beside the bear [m], where each vertex first comes through the ring's plane; negative beside
    the hole. Where the bear does not come through, minus how far its middle stays from the ring's, and the hole.
    """
    level = run.levels[-1]
    states = np.array([level.positions(step) for step in range(level.steps)]) - RING
    before, after = states[:-1], states[1:]
    through = (before[..., 0] < 0.0) & (after[..., 0] >= 0.0)
    if not through.any(axis=0).all():
        return -HOLE - float(np.linalg.norm(states.mean(axis=1), axis=1).min())
    first, vertices = through.argmax(axis=0), np.arange(states.shape[1])
    a, b = before[first, vertices], after[first, vertices]
    places = a + (a[:, :1] / (a[:, :1] - b[:, :1])) * (b - a)
    return HOLE - float(np.linalg.norm(places[:, 1:], axis=1).max())


def through_and_sits(run):
    """1 where the bear comes through the ring with a margin and ends upright, quiet, on the step; less by what each of
    these lacks. `GOOD` says from where on the shot works.
    """
    on_step = lands_in("bear", (LOWER + [0.15, UPPER[1], 0.15]).tolist(), (UPPER + [-0.15, SIZE, -0.15]).tolist())
    lacks = (
        max(0.0, MARGIN - clearance(run)) / SIZE,
        max(0.0, -on_step(run)),
        (1.0 - upright("bear", axis=(0.0, 1.0, 0.0))(run)) / 2.0,
        max(0.0, -quiet("bear")(run) - 0.1),
    )
    return 1.0 - sum(lacks)


if __name__ == "__main__":
    pdvol.main(scene)
