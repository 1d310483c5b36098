"""A gnome falls on a letter block (paper, figure "dice and wizard"): on level 0 the block is a plain cube, on level 1
letters are cut deep into it.

Does the gnome come to rest where level 0 puts it, and does it settle into the letter below it?

    pdvol run demos/dice_and_wizard.py --set soft=False
"""

import numpy as np

import pdvol
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes

EDGE = 0.4  # m, of the block
SOFT, STIFF = 2e5, 1e8  # Pa, Young's modulus of the block


def scene(
    soft=True,
    vertices=(350, 5000),
    block=(216, 3500),
    young=3e4,
    height=0.12,
    lean=80.0,
    mu=0.4,
    damping=0.02,
    steps=120,
    dt=0.01,
):
    """The gnome, leaning forward by `lean` degrees, falls from `height` m above the block, which is `soft` or stiff.

    `vertices` and `block` are the levels' sizes: of the gnome and of the block, whose level 0 always has 216.
    """
    toy = NeoHookean(SOFT if soft else STIFF, 0.4, 1000.0, damping=damping if soft else 0.0)
    return Scene(
        bodies=(
            Body(
                meshes.gnome(0.6, 8000),
                NeoHookean(young, 0.4, 1000.0, damping=damping),
                tuple(vertices),
                name="gnome",
                placement=Placement((0.02, EDGE + height + 0.12, -0.30), np.radians(lean), (1.0, 0.0, 0.0)),
            ),
            Body(
                (meshes.brick((EDGE, EDGE, EDGE), (5, 5, 5)), meshes.letter_block(EDGE, 0.12, 6000)),
                toy,
                tuple(block),
                name="block",
                placement=Placement((0.0, EDGE / 2.0 + 0.002, 0.0)),
            ),
        ),
        obstacles=(Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="ground"),),
        loads=(Gravity((0.0, -9.81, 0.0)),),
        contact=(Barrier(), Friction(mu)),
        dt=dt,
        steps=steps,
    )


if __name__ == "__main__":
    pdvol.main(scene)
