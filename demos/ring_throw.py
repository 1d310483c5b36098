"""A soft frog, lying on its back, is thrown through a ring, and has to end on its feet on a step behind it.

Few throws do. A search finds one on level 0:

    pdvol wedge demos/ring_throw.py --seek through_and_on_its_feet --vary speed=4:6 --vary angle=50:70 \\
        --vary aim=-4:4 --vary spin=-15:15 --goal 0.98 --runs 300 -o throws
    pdvol pick throws best --refine
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, meshes
from pdvol.studio.wedge.scored_body import at_level
from pdvol.studio.wedge.scores import lands_in, quiet, upright

SCALE, HEIGHT = 0.4, 0.24  # of the frog's shape; m, its height then
START = np.array([0.0, 0.6, 0.0])  # m, where the middle of the frog is thrown from
FORWARD = (1.0, 0.0, 1.0)  # half a turn about it lays the frog on its back, its nose along x
RING = np.array([1.1, 1.4, 0.0])  # m, the ring's middle; its axis is x
HOLE, TUBE = 0.30, 0.05  # m, radii of the ring's hole and tube
LOWER, UPPER = np.array([1.6, 0.0, -0.5]), np.array([2.8, 0.9, 0.5])  # m, corners of the step
MARGIN = 0.02  # m, what is left between frog and ring, at least
STILL = 0.02  # m/s: a frog that rocks on its step is faster, but where it turns round
TOUCH = 0.5  # what the score lacks where nothing of the margin is left: a frog that grazes the ring goes elsewhere next
GOOD = 0.93  # the score from which on the shot works


def scene(
    speed=5.0,
    angle=55.0,
    aim=0.0,
    spin=0.0,
    vertices=(150, 400, 1000),
    young=2e5,
    damping=0.06,
    mu=0.8,
    steps=110,
    dt=0.02,
):
    """The frog is thrown at `speed` m/s, `angle` degrees above the ground and `aim` degrees to the side, turning at
    `spin` rad/s about the axis across the throw.
    """
    up, side = np.radians([angle, aim])
    direction = np.array([np.cos(up) * np.cos(side), np.sin(up), np.cos(up) * np.sin(side)])
    frog = Body(
        meshes.frog(),
        NeoHookean(young, 0.4, 1000.0, damping=damping),
        tuple(vertices),
        name="frog",
        velocity=tuple(speed * direction),
        spin=(0.0, 0.0, spin),
        placement=Placement(tuple(START + [0.0, HEIGHT / 2, 0.0]), np.pi, FORWARD, SCALE),
    )
    across = Placement(translate=tuple(RING), angle=np.pi / 2)
    middle = Placement(translate=tuple((LOWER + UPPER) / 2 + [0.0, 0.001, 0.0]))
    return Scene(
        bodies=(frog,),
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
    """What the ring leaves beside the frog [m], where each vertex first comes through the ring's plane; negative beside
    the hole. Where the frog does not come through, minus how far its middle stays from the ring's, and the hole.
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


def through_and_on_its_feet(run):
    """1 where the frog comes through the ring with a margin and ends upright, quiet, on the step; less by what each of
    these lacks. `GOOD` says from where on the shot works.
    """
    inside = (LOWER + [0.15, UPPER[1], 0.15]).tolist(), (UPPER + [-0.15, HEIGHT, -0.15]).tolist()
    left = clearance(run)
    lacks = (
        max(0.0, -left) / HEIGHT,
        TOUCH * min(1.0, max(0.0, 1.0 - left / MARGIN)),
        max(0.0, -lands_in("frog", *inside)(run)),
        (1.0 - upright("frog", axis=(0.0, 1.0, 0.0))(run)) / 2.0,
        min(1.0, max(0.0, -quiet("frog")(run) - STILL)),
    )
    return 1.0 - sum(lacks)


def claim(run):
    """The throw works on every level."""
    seen = [at_level(run, level.index) for level in run.levels]
    scores = [through_and_on_its_feet(each) for each in seen]
    leans = [np.degrees(np.arccos(upright("frog", axis=(0.0, 1.0, 0.0))(each))) for each in seen]
    beside, lean = ", ".join(f"{100 * clearance(each):.1f}" for each in seen), ", ".join(f"{x:.1f}" for x in leans)
    sentence = f"On the levels {beside} cm lie between frog and ring, and the frog ends {lean} degrees from upright;"
    shown = ", ".join(f"{score:.3f}" for score in scores)
    return [(f"{sentence} scores are {shown}, at least {GOOD}.", min(scores) >= GOOD)]


if __name__ == "__main__":
    pdvol.main(scene)
