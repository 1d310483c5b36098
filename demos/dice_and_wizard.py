"""A gnome falls on a letter block (paper, figure "dice and wizard"): on level 0 the block is a plain cube, on level 1
letters are cut deep into it.

Does the gnome come to rest where level 0 puts it, and does it settle into the letter below it?

    pdvol run demos/dice_and_wizard.py --set soft=False
"""

import igl
import numpy as np
from mpi4py import MPI

import pdvol
import recipes
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, meshes
from pdvol.levels.hierarchy import Hierarchy
from pdvol.runs.run_metrics import motion_from_level_0

EDGE = 0.4  # m, of the block
HEIGHT = 0.6  # m, of the gnome
CLOSE = 1e-3  # m, gap of a vertex that counts as touching: the `dhat` of this scene
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
                recipes.gnome(HEIGHT, 8000),
                NeoHookean(young, 0.4, 1000.0, damping=damping),
                tuple(vertices),
                name="gnome",
                placement=Placement((0.02, EDGE + height + 0.12, -0.30), np.radians(lean), (1.0, 0.0, 0.0)),
            ),
            Body(
                (meshes.brick((EDGE, EDGE, EDGE), (5, 5, 5)), recipes.letter_block(EDGE, 0.12, 6000)),
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


def reach(run, level):
    """How deep the gnome reaches into the upper letter at the end [m], below the block's upper face there."""
    bodies, last = run.levels[level].mesh.point_bodies, run.levels[level].positions(run.levels[level].steps - 1)
    gnome, block = last[bodies == 0], last[bodies == 1]
    rest = run.levels[level].rest[bodies == 1]
    face = block[rest[:, 1] > rest[:, 1].max() - 1e-3]  # what is left of the upper face between the letters
    beside = np.abs(gnome[:, [0, 2]] - block.mean(axis=0)[[0, 2]]).max(axis=1) < 0.4 * EDGE
    return float(face[:, 1].mean() - gnome[beside, 1].min())


def gaps(level, positions):
    """(n,) From each vertex of the gnome's surface to that of the block [m]; negative inside it."""
    owners = level.mesh.point_bodies[level.surface[:, 0]]
    gnome, block = np.unique(level.surface[owners == 0]), level.surface[owners == 1].astype(np.int64)
    return igl.signed_distance(positions[gnome], positions, np.ascontiguousarray(block))[0]


def claim(run):
    """The gnome rests where level 0 puts it, and reaches into the letter on the level that has one. Embedded, as level
    1 without a solve, it would be inside the block.
    """
    found = [
        (
            f"On level {entry['level']} the bodies end within {1000 * entry['centre_drift']:.0f} mm of where level 0"
            " has them, less than 5 % of the gnome's height.",
            entry["centre_drift"] < 0.05 * HEIGHT,
        )
        for entry in motion_from_level_0(run)[1:]
    ]
    plain, cut = reach(run, 0), reach(run, len(run.levels) - 1)
    sentence = f"The gnome reaches {1000 * cut:.1f} mm below the face of the engraved block,"
    found.append((f"{sentence} and {1000 * plain:.1f} mm below that of the plain one.", cut > plain))
    coarse, fine, last = *run.levels[:2], run.info["steps"]
    pair = Hierarchy([coarse.mesh, fine.mesh], MPI.COMM_SELF, run.info["prolongation"])
    own, only = gaps(fine, fine.positions(last)), gaps(fine, pair.prolong(coarse.positions(last), 0, 1))
    inside, alone = int((own < 0).sum()), int((only < 0).sum())
    near, near_alone = (int(((x >= 0) & (x < CLOSE)).sum()) for x in (own, only))
    sentence = f"{inside} vertices of level 1's gnome end inside the block, {near} less than {1000 * CLOSE:.0f} mm from"
    sentence += f" it. If level 1 only followed level 0, these were {alone} and {near_alone}."
    return [*found, (sentence, inside == 0)]


if __name__ == "__main__":
    pdvol.main(scene)
