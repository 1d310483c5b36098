"""Two fingers that a rig drives close on a soft ball, lift it by friction alone, and hold it.

The fingers are meshes that bend from frame to frame at 24 frames a second, as a point cache from an animation program
would have them. Where they grip they are straight and upright: without friction (`--set mu=0`) the ball stays below.

    pdvol run demos/gripper.py                # runs/gripper
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Deforming, Friction, Gravity, NeoHookean, Placement, Plane, PointCache, Scene, meshes

RADIUS, GAP = 0.25, 5e-3  # m: of the ball, and between it and the floor at first
LENGTH, WIDTH, THICKNESS = 0.5, 0.3, 0.06  # m, of a finger
FPS = 24.0  # frames a second of the rig
CLOSED, LIFTING, LIFTED = 0.4, 0.5, 1.1  # s: when the fingers have closed, begin to rise, and have risen


def eased(time, start, end):
    """0 before `start`, 1 after `end`, smooth in between."""
    s = np.clip((time - start) / (end - start), 0.0, 1.0)
    return s * s * (3.0 - 2.0 * s)


def finger(side, squeeze, lift):
    """The point cache of one finger, to the right of the ball (side = 1) or to its left (-1).

    It hangs down from its upper end. Open, it is bent away from the ball; closed, it is straight, and its inner face
    `squeeze` [m] within the ball's outline. Then it rises by `lift` [m], and rests after the last
    frame.
    """
    rest = meshes.box((THICKNESS, WIDTH, LENGTH), (1, 4, 8))
    across, along, down = rest.vertices[:, 0], rest.vertices[:, 1], 0.5 * LENGTH - rest.vertices[:, 2]
    frames = []
    for time in np.arange(0.0, LIFTED + 1.0 / FPS, 1.0 / FPS):
        opened = 1.0 - eased(time, 0.0, CLOSED)
        bend = 1e-6 + 1.2 * opened  # 1/m, the middle line's curvature
        away = (1.0 - np.cos(bend * down)) / bend + across * np.cos(bend * down)
        below = np.sin(bend * down) / bend - across * np.sin(bend * down)
        place = RADIUS - squeeze + 0.5 * THICKNESS + 0.12 * opened + away
        top = GAP + RADIUS + 0.55 * LENGTH + lift * eased(time, LIFTING, LIFTED)
        frames.append(np.column_stack([side * place, along, top - below]))
    return PointCache(np.array(frames), fps=FPS, faces=rest.triangles[:, ::side])


def scene(vertices=(150, 600), squeeze=0.05, lift=0.4, mu=0.7, young=5e4, damping=0.03, steps=150, dt=0.01):
    """`squeeze` [m] is how far each finger presses into the ball, `lift` [m] how far it rises, `mu` its friction.
    Without `damping` [s] the ball swings between the fingers.
    """
    fingers = [
        Deforming(finger(side, squeeze, lift), name=f"{name} finger") for side, name in ((-1, "left"), (1, "right"))
    ]
    return Scene(
        bodies=(
            Body(
                meshes.ball(RADIUS),
                NeoHookean(young, 0.4, 400.0, damping=damping),
                tuple(vertices),
                name="ball",
                placement=Placement(translate=(0.0, 0.0, GAP + RADIUS)),
            ),
        ),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="floor"), *fingers),
        loads=(Gravity((0.0, 0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def hold(run):
    """What the fingers have done on each level of a stored run: how far the ball's mean position has risen [m], its
    vertical speed [m/s] over the last tenth of a second, and its lowest point above the floor [m] at the end.
    """
    found = []
    for level in run.levels:
        last, before = level.steps - 1, level.steps - 1 - round(0.1 / run.dt)
        heights = [level.positions(step)[:, 2].mean() for step in (0, before, last)]
        found.append(
            {
                "risen": heights[2] - heights[0],
                "speed": (heights[2] - heights[1]) / 0.1,
                "above": level.positions(last)[:, 2].min(),
            }
        )
    return found


def claim(run):
    """The ball is lifted and held by friction, alike on all levels, and what drives the fingers keeps its time."""
    held, late = hold(run), max(record["behind"] for level in run.levels for record in level.log)
    risen = [found["risen"] for found in held]
    heights = ", ".join(f"{height:.3f}" for height in risen)
    fastest, apart = max(abs(found["speed"]) for found in held), max(risen) - min(risen)
    return [
        (
            f"The fingers rise by 0.4 m, and the ball by {heights} m on the levels.",
            min(risen) > 0.35 and min(found["above"] for found in held) > 0.3,
        ),
        (f"These heights are within {1000 * apart:.1f} mm.", apart < 0.02),
        (f"It is held: at the end it moves up or down by less than {1000 * fastest:.1f} mm/s.", fastest < 0.02),
        ("The fingers are where the rig wants them in every step.", late == 0.0),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
