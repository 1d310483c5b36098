"""A shelf of sixty soft toys that settle and then lie still (the long rest).

Do they stay where they are, and does a step at rest cost next to nothing?
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Rigid, Scene, meshes

BOARDS = (0.0, 0.34, 0.68)  # m, upper sides of the boards
BOARD = (2.0, 0.03, 0.46)  # m, length, thickness and depth of a board
COLUMNS, ROWS = 10, 2  # toys on a board
GAP = 0.004  # m, that they fall


def scene(vertices=(60, 200), count=60, young=2e5, mu=0.5, damping=0.05, steps=1200, dt=0.01):
    """`count` toys of six kinds, filled in from the lowest board up."""
    material = NeoHookean(young, 0.4, 1000.0, damping=damping)
    toys = (  # name, shape, height [m] of its middle or feet over the board
        ("cube", meshes.box((0.13, 0.13, 0.13), 3), 0.065),
        ("frog", meshes.frog(0.09), 0.0),
        ("ring", meshes.torus(0.055, 0.022, 24, 10), 0.022),
        ("bear", meshes.creature(0.18), 0.0),
        ("drum", meshes.cylinder(0.06, 0.12, 24), 0.06),
        ("bunny", meshes.bunny(0.19), 0.0),
    )
    kinds = [Body(shape, material, tuple(vertices), name=name) for name, shape, _ in toys]
    places: list[list[Placement]] = [[] for _ in toys]
    for k in range(count):
        board, place = divmod(k, COLUMNS * ROWS)
        column, row = divmod(place, ROWS)
        x = BOARD[0] * ((column + 0.5) / COLUMNS - 0.5)
        z = BOARD[2] * ((row + 0.5) / ROWS - 0.5)
        kind = (column + 2 * row + board) % len(toys)
        places[kind].append(
            Placement((x, BOARDS[board] + toys[kind][2] + GAP, z), np.radians(15.0 * np.sin(7.0 * k)), (0.0, 1.0, 0.0))
        )
    return Scene(
        bodies=tuple(body for kind, mine in zip(kinds, places, strict=True) for body in kind.instances(*mine)),
        obstacles=tuple(
            Rigid(
                meshes.box(BOARD, (8, 1, 2)),
                name=f"board {number}",
                placement=Placement((0.0, top - BOARD[1] / 2.0, 0.0)),
            )
            for number, top in enumerate(BOARDS, 1)
        ),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """In the last share of the run nothing creeps, and steps cost next to nothing."""
    found = []
    for level in run.levels:
        first, last = (level.steps - 1) // 2, level.steps - 1
        bodies, seconds = level.mesh.point_bodies, (last - first) * run.dt
        count = np.bincount(bodies)[:, None]
        ends = [
            np.column_stack([np.bincount(bodies, axis) for axis in level.positions(step).T]) / count
            for step in (first, last)
        ]
        creep = float(np.linalg.norm(ends[1] - ends[0], axis=1).max()) / seconds
        cost = [record["seconds"]["cpu"] for record in level.log]
        share = np.mean(cost[first:]) / np.mean(cost[:50])
        found += [
            (
                f"On level {level.index} no toy creeps faster than {1e6 * creep:.1f} um/s in the last {seconds:.3g} s.",
                creep < 1e-3 * run.info["diagonal"],
            ),
            (f"A step then costs {100 * share:.1f} % of one while they settle.", share < 0.05),
        ]
    return found


if __name__ == "__main__":
    pdvol.main(scene)
