"""Smoothed elements beside linear ones: free vibrations of an ape, and time of everyday steps in turn.

    ./run python -m benchmarks.elements [--rows drop_500,twistx_1k] [--steps 60] [--runs 3]

Frequencies are squared, over those of the finest smoothed mesh: what a body is stiffer than it should be. Rows are
those of benchmarks.dense; figures of linear elements stand first. The tables are written between the markers of
NOTES.md beside this file.
"""

import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array
from scipy.sparse.linalg import eigsh

from benchmarks.common import march
from benchmarks.common.process import REPOSITORY, machine
from benchmarks.common.rows import NAMES, ROWS, chosen
from benchmarks.common.study import command, each
from benchmarks.common.tables import Page, table
from pdvol.geometry.level_mesh import LevelMesh, lumped_masses
from pdvol.levels.materials import cell_materials
from pdvol.levels.space import LevelSpace
from pdvol.meshing.build import build_levels
from pdvol.potentials.assembly.hessian_blocks import BlockPattern, HessianBlocks
from pdvol.potentials.elasticity import elastic_terms
from pdvol.potentials.potential import Positions
from pdvol.runs.scene_file import load_shot
from pdvol.scene import Body, Material, Scene

ELEMENTS = ("linear", "smoothed")
"""In the order of the tables' columns."""
EVERYDAY = ("drop_500", "twistx_1k", "drop_4k", "blocks", "stack", "plates", "balls")
RIGID, LOWEST = 6, 6
"""Modes of a free body that cost nothing, and modes above them that are compared."""


@command(
    "elements",
    __doc__,
    {
        "--rows": {**NAMES, "help": f"rows (default: {', '.join(EVERYDAY)})"},
        "--steps": {"type": int, "default": 60, "help": "of a row at most (default: 60)"},
        "--runs": {"type": int, "default": 3, "help": "of each kind of elements (default: 3)"},
        "--docs": {"type": Path, "default": Path(__file__).with_name("NOTES.md"), "help": "where tables are kept"},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    names, page = chosen(options.rows, ROWS, EVERYDAY), Page(options.docs, "elements")

    def measured(name: str) -> dict:
        row, steps = ROWS[name], ROWS[name].most(options.steps)
        with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
            rows = {kind: replace(row, settings={**row.settings, "elements": kind}) for kind in ELEMENTS}
            sides = {kind: partial(march.march, own, Path(folder) / "run", steps) for kind, own in rows.items()}
            return march.in_turn(sides, options.runs)

    times = each(names, measured, lambda name, records: [march.versus(ROWS[name].title, records)])
    own = machine()
    made_on = f"{own['processor']}, one of {own['cores']} cores."
    report = "\n\n".join([made_on, stiffness(), table(march.HEAD, times)])
    print(report)
    page.write(report)


def stiffness() -> str:
    """The table of the levels of demos/ape.py: their lowest squared frequencies, and nonzeros of their matrices."""
    scene = load_shot(REPOSITORY / "demos" / "ape.py").scene
    meshes, material = build_levels(scene), scene.bodies[0].material
    found = [{kind: vibrations(mesh, material, kind) for kind in ELEMENTS} for mesh in meshes]
    best, lines = found[-1]["smoothed"][0], []
    for mesh, level in zip(meshes, found, strict=True):
        ratios = [level[kind][0] / best for kind in ELEMENTS]
        cells = [f"{np.mean(ratio):.2f} (largest {max(ratio):.2f})" for ratio in ratios]
        lines.append([f"{len(mesh.points):,}", *cells, f"{level['smoothed'][1] / level['linear'][1]:.2f}"])
    return table(["ape: vertices", *ELEMENTS, "nonzeros, times those of linear ones"], lines)


def vibrations(mesh: LevelMesh, material: Material, elements: str) -> tuple[np.ndarray, int]:
    """The squared angular frequencies (LOWEST,) [1/s^2] of a free body above those of rigid motions, with lumped
    masses, and the number of blocks of the matrix.
    """
    scene = Scene((Body(("mesh",), material),), dt=0.01, steps=1, elements=elements)
    space, materials = LevelSpace(mesh, MPI.COMM_SELF), cell_materials(scene, mesh)
    terms = elastic_terms(space, materials)
    blocks = HessianBlocks(BlockPattern(space, [domains for term in terms for domains in term.stencils]), "none")
    for term in terms:
        term.add_hessian(Positions(space, space.from_input(mesh.points)), 1.0, blocks)
    starts, columns, values = blocks.merged()
    n = len(mesh.points)
    whole = lambda *rows: csr_array(bsr_array(rows, shape=(3 * n, 3 * n)))
    upper = whole(values, columns, starts)
    stiff = csc_array(upper + upper.T - whole(values[starts[:-1]], np.arange(n), np.arange(n + 1)))
    masses = np.repeat(space.from_input(lumped_masses(mesh, materials.density)), 3)
    shift = -0.05 * material.young / material.density  # the matrix alone is singular
    mass = diags_array(masses, format="csc")
    found = eigsh(stiff, RIGID + LOWEST, mass, sigma=shift, v0=np.ones(3 * n), return_eigenvectors=False)
    return np.sort(found)[RIGID:], 2 * blocks.pattern.count - n


if __name__ == "__main__":
    sys.exit(main())
