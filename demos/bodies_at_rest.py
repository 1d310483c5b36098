"""A shelf of sixty soft toys that settle and then lie still (the long rest).

Do they stay where they are, and does a step at rest cost less than one in motion?
"""

import numpy as np

import pdvol
import recipes
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Rigid, Scene, meshes

BOARDS = (0.0, 0.34, 0.68)  # m, upper sides of the boards
BOARD = (2.0, 0.03, 0.46)  # m, length, thickness and depth of a board
COLUMNS, ROWS = 10, 2  # toys on a board
GAP = 0.004  # m, that they fall
EPS_V = 1e-4  # m/s, below which friction is smoothed: what is held by friction creeps more slowly than this
MOTION, SETTLED = 0.5, 3.0  # s: until when the toys land and rock, and from when on they are at rest


def scene(vertices=(60, 200), count=60, young=1e6, mu=0.5, damping=0.05, steps=1300, dt=0.01):
    """`count` toys of six kinds, filled in from the lowest board up."""
    material = NeoHookean(young, 0.4, 1000.0, damping=damping)
    toys = (  # name, shape, height [m] of its middle or feet over the board
        ("cube", meshes.box((0.13, 0.13, 0.13), 3), 0.065),
        ("frog", meshes.frog(0.09), 0.0),
        ("ring", meshes.torus(0.055, 0.022, 24, 10), 0.022),
        ("bear", meshes.creature(0.18), 0.0),
        ("drum", meshes.cylinder(0.06, 0.12, 24), 0.06),
        ("gnome", recipes.gnome(0.19), 0.0),
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
        contact=(Barrier(), Friction(mu, eps_v=EPS_V)),
        dt=dt,
        steps=steps,
    )


def claim(run):
    """They stay where they are but for the creep that smoothed friction allows, and resting takes few iterations."""
    moving, first, last = round(MOTION / run.dt), round(SETTLED / run.dt), run.info["steps"]
    moments = [*range(first, last, round(0.5 / run.dt)), last]
    creeps, costs, moved = [], [], 0.0
    for level in run.levels:
        states = [level.positions(step) for step in moments]
        times = np.diff(moments) * run.dt
        ways = [np.linalg.norm(after - before, axis=1).max() for before, after in zip(states, states[1:], strict=False)]
        creeps.append(float((np.array(ways) / times).max()))
        moved = max(moved, float(np.linalg.norm(states[-1] - states[0], axis=1).max()))
        iterations = np.array([record["newton_iterations"] for record in level.log])
        costs.append((iterations[first:].mean(), iterations[:moving].mean()))
    still, busy = zip(*costs, strict=True)
    shown, at_rest, at_first = (
        ", ".join(f"{factor * x:.{digits}f}" for x in found)
        for factor, digits, found in ((1e6, 0, creeps), (1, 2, still), (1, 1, busy))
    )
    return [
        (
            f"From {SETTLED:g} s to the end, at {last * run.dt:g} s, nothing moves by more than {1000 * moved:.2f} mm.",
            moved < EPS_V * last * run.dt,
        ),
        (f"It creeps at most at {shown} um/s on the levels; eps_v is {1e6 * EPS_V:.0f} um/s.", max(creeps) < EPS_V),
        (
            f"A step at rest takes {at_rest} Newton iterations on the levels, one in the first half second {at_first}.",
            max(still) < 2.5,
        ),
    ]


if __name__ == "__main__":
    pdvol.main(scene)
