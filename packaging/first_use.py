"""`python packaging/first_use.py`: compiles what the first run of a scene would wait for: C code, the forms of pdvol's
laws in 2D and in 3D, and Python's bytecode. `./run` does this when it has built an environment.
"""

import tempfile
from pathlib import Path

import numpy as np

import pdvol
from pdvol import Barrier, Body, FixedCorotational, Friction, Gravity, NeoHookean, Plane, Scene, StVenantKirchhoff
from pdvol.studio.draw.picture import render

LAWS = (NeoHookean(1e5, damping=0.01), StVenantKirchhoff(1e5), FixedCorotational(1e5))


def scene(dim: int) -> Scene:
    """A simplex of each law, beside each other on the ground."""
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    cell = np.arange(dim + 1, dtype=np.int32)[None]
    up = np.eye(dim)[-1]
    first = corners + 1e-3 * up
    shapes = [
        pdvol.Solid(first + 2.0 * place * np.eye(dim)[0], cell, np.zeros(1, np.int32)) for place in range(len(LAWS))
    ]
    return Scene(
        bodies=tuple(Body((shape,), law, name=type(law).__name__) for shape, law in zip(shapes, LAWS, strict=True)),
        obstacles=(Plane(np.zeros(dim), up),),
        loads=(Gravity(-9.81 * up),),
        contact=(Barrier(), Friction(0.3)),
        dt=0.01,
        steps=1,
    )


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        for dim in (2, 3):
            run = pdvol.run(scene(dim), Path(folder, str(dim)))
            render(run, Path(folder, "picture.png"))
