"""A catapult: a straight leaf of rubber starts bent back, is held so for a moment, and throws a ball when it is let go.

The arm's mesh is straight, and that is the shape without stress; `start` bends it, on each level by the same function.
Levels that are simulated on their own (`--method direct`) throw to different places.
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Rigid, Scene, Support, meshes

LENGTH, THICKNESS, FOOT, RADIUS = 0.6, 0.05, 0.08, 0.05  # m: of the arm, its clamped foot, and the ball
LIP = 0.03  # m: width and height of the edge that keeps the ball on the arm
GAP = 3e-3  # m: between ball and arm, ball and lip, and above the floor
BUCKET = 1.0, 1.3  # m: from where to where it is open


def bent(angle):
    """The arm's bend to the left: a function of rest positions that turns its tip by `angle` [rad]."""
    curvature = angle / (LENGTH - FOOT)

    def start(X):
        """The middle becomes a straight foot and an arc, and sections stay straight and across it."""
        along = np.maximum(X[:, 1] - FOOT, 0.0)
        turn = curvature * along
        middle = np.column_stack(
            [(np.cos(turn) - 1.0) / curvature, np.minimum(X[:, 1], FOOT) + np.sin(turn) / curvature]
        )
        return middle + X[:, :1] * np.column_stack([np.cos(turn), np.sin(turn)])

    return start


def scene(vertices=(90, 300), balls=(40, 120), young=8e6, angle=1.5, hold=0.1, mu=0.5, steps=200, dt=0.005):
    """The tip is turned by `angle` [rad] and let go after `hold` [s]."""
    half, start = 0.5 * THICKNESS, bent(angle)
    side = [(half, 0.0), (half, LENGTH - LIP), (half + LIP, LENGTH - LIP), (half + LIP, LENGTH)]
    (left, right), wall = BUCKET, 0.02
    sides = [(left - wall, 0.0), (right + wall, 0.0), (right + wall, 0.3), (right, 0.3)]
    bucket = [*sides, (right, wall), (left, wall), (left, 0.12), (left - wall, 0.12)]
    arm = Body(
        meshes.polygon([(-half, 0.0), *side, (-half, LENGTH)]),
        NeoHookean(young, 0.45, 400.0, damping=2e-3),
        tuple(vertices),
        name="arm",
        start=start,
    )
    (place,) = start(np.array([[half + RADIUS + GAP, LENGTH - LIP - RADIUS - GAP]]))
    ball = Body(
        meshes.disc(RADIUS),
        NeoHookean(2e5, 0.45, 500.0, damping=2e-3),
        tuple(balls),
        name="ball",
        placement=Placement(translate=tuple(place)),
    )
    return Scene(
        bodies=(arm, ball),
        supports=(
            Support(lambda X: X[:, 1] < FOOT, body="arm"),
            Support(lambda X: X[:, 1] > LENGTH - LIP, body="arm", release=hold),
        ),
        obstacles=(Plane((0.0, -GAP), (0.0, 1.0), name="floor"), Rigid(meshes.polygon(bucket), name="bucket")),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """The ball ends in the bucket on all levels, by the same way."""
    last, levels = run.info["steps"], run.levels
    bends = [_tip(level, 0).tolist() for level in levels]
    ways = np.array([[_ball(level, step) for step in range(last + 1)] for level in levels])  # m
    apart, alike = float(np.linalg.norm(ways - ways[0], axis=2).max()), float(np.ptp(bends, axis=0).max())
    ends, stands = ways[:, -1], [_tip(level, last) for level in levels]
    inside = bool(((ends[:, 0] > BUCKET[0]) & (ends[:, 0] < BUCKET[1]) & (ends[:, 1] < 0.12)).all())
    places = ", ".join(f"{x:.3f}" for x in ends[:, 0])
    tips = ", ".join(f"({x:+.3f}, {y:.3f})" for x, y in bends)
    return [
        (f"The arm starts bent alike on all levels: its tip is at {tips} m.", alike < 1e-6 and bends[0][0] < -0.25),
        (f"The ball ends in the bucket, {places} m from the arm's foot.", inside),
        (f"At every moment its places on the levels are within {1000 * apart:.0f} mm.", apart < 0.03),
        ("At the end the arm stands upright.", all(abs(x) < 0.2 and y > 0.95 * LENGTH for x, y in stands)),
    ]


def _ball(level, step):
    """The ball's centre [m]."""
    return level.positions(step)[level.mesh.point_bodies == 1].mean(axis=0)


def _tip(level, step):
    """Where the corner at the left of the arm's tip is [m]."""
    arm = np.flatnonzero(level.mesh.point_bodies == 0)
    return level.positions(step)[arm[np.argmax(level.rest[arm, 1] - level.rest[arm, 0])]]


if __name__ == "__main__":
    pdvol.main(scene)
