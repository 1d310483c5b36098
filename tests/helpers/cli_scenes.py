"""A scene file so small that the tests of the command line are about the command line: a square of a few triangles
falls on a plane.
"""

import io
from contextlib import redirect_stderr
from pathlib import Path

from pdvol import cli

SQUARE = '''
import numpy as np
import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Outline, Placement, Plane, Rigid, Scene, Solid, Support
from pdvol import Surface


def square(n):
    """The unit square as 2 n^2 triangles."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    cells = np.vstack([np.column_stack([a, a + 1, a + n + 2]), np.column_stack([a, a + n + 2, a + n + 1])])
    return Solid(np.column_stack([x.ravel(), y.ravel()]), cells.astype(np.int32), np.zeros(len(cells), np.int32))
'''

FALL = (
    SQUARE
    + """

def scene(young=2e4, height=0.02, mu=0.3, steps=10, velocity=(0.3, 0.0), sizes=(2, 4)):
    return Scene(
        bodies=(Body(tuple(square(n) for n in sizes), NeoHookean(young), name="square", velocity=velocity,
                     placement=Placement(translate=(0.0, height), angle=0.05)),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0), name="floor"),),
        loads=(Gravity((0.0, -9.81)),),
        contact=(Barrier(), Friction(mu)),
        dt=0.02,
        steps=steps,
    )
"""
)

DROP = """
import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes


def scene(young=2e4, height=0.1, cuts=(1, 2), steps=10, turn=0.3):
    shapes = tuple(meshes.brick((1.0, 0.6, 0.6), (2 * n, n, n)) for n in cuts)
    return Scene(
        bodies=(Body(shapes, NeoHookean(young), name="brick",
                     placement=Placement(translate=(0.0, 0.0, 0.45 + height), angle=turn, axis=(0.0, 1.0, 0.0))),),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), name="floor"),),
        loads=(Gravity((0.0, 0.0, -9.81)),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.02,
        steps=steps,
    )
"""
"""A brick of 12 vertices, then 45, that falls on a floor."""

BOUNCE = """
import sys
import time
from pathlib import Path
import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Plane, Scene, Solver
from pdvol.meshes import disc

print("loaded")

def gravity(t):
    program, *words = sys.argv
    if Path(program).name == "level_processes.py":  # the check before the run calls it, too
        if t > fails:
            raise ValueError("no gravity any more")
        while waits and words[1] == "0" and t > 0.05 and pdvol.open_run(words[0]).levels[1].steps < 2:
            time.sleep(0.01)
    return (0.0, -9.81)

def scene(vertices=(60, 120), steps=8, until=1e9, beside=False, iterations=200, halvings=6, tolerance=1e-4):
    global fails, waits
    fails, waits = until, beside
    ball = Body(disc(0.5), NeoHookean(5e4), vertices=vertices, velocity=(0.5, -3.0))
    return Scene(bodies=(ball,), dt=0.01, steps=steps, loads=(Gravity(gravity),),
                 obstacles=(Plane((0.0, -0.55), (0.0, 1.0)),), contact=(Barrier(), Friction(0.5)),
                 solver=Solver(tolerance=tolerance, max_iterations=iterations, max_halvings=halvings))
"""
"""A disc, whose gravity fails in the process of a level after a time, or waits in that of level 0 until level 1 runs
beside it.
"""

CUBE = """
import pdvol
from pdvol import Body, Gravity, NeoHookean, Scene

def scene(vertices=(60, 150), steps=2):
    body = Body("cube.off", NeoHookean(1e4), vertices, name="cube")
    return Scene((body,), dt=0.01, steps=steps, loads=(Gravity((0.0, 0.0, -9.81)),))
"""
"""The cube of a file beside it."""

CUBE_OFF = """OFF
8 12 0
0 0 0
1 0 0
1 1 0
0 1 0
0 0 1
1 0 1
1 1 1
0 1 1
3 0 2 1
3 0 3 2
3 4 5 6
3 4 6 7
3 0 1 5
3 0 5 4
3 1 2 6
3 1 6 5
3 2 3 7
3 2 7 6
3 3 0 4
3 3 4 7
"""


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def pdvol(*words) -> int:
    """One command line, in this process; its exit code, argparse's included."""
    try:
        return cli.run([str(word) for word in words])
    except SystemExit as end:
        return int(end.code or 0)


def pdvol_on_ranks(comm, *words) -> dict:
    """A command line on these ranks, without a picture: its exit code, and what all ranks write to standard error."""
    with redirect_stderr(io.StringIO()) as said:
        code = cli.run([*map(str, words), "--no-picture"])
    return {"code": code, "said": "".join(comm.gather(said.getvalue()) or ())}


def states(run, level):
    """Every stored state of a level, as bytes by file name."""
    return {p.name: p.read_bytes() for p in sorted((run / "levels" / str(level)).iterdir())}
