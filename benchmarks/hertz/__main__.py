"""Hertz contact under refinement: a hemisphere pressed onto a plane, beside the analytic solution.

    ./run python -m benchmarks.hertz [--cells 8,16,32] [--ratios 0.2,0.1,0.05] [--out runs/hertz]

Cell size h and contact distance dhat shrink together at one contact radius; then the contact radius shrinks in
proportion to the hemisphere, with h and dhat in proportion to it. The first shows discretisation errors, the second
the error of Hertz's half-space on a finite body. The tables are printed, and kept in hertz.md.
"""

import sys
import time
from collections.abc import Sequence
from itertools import product
from pathlib import Path

import numpy as np
from mpi4py import MPI

from benchmarks.common.process import REPOSITORY, Mistake
from benchmarks.common.scenes import first_order
from benchmarks.common.study import command, each
from benchmarks.common.tables import number, table
from pdvol.geometry.level_mesh import LevelMesh, boundary_areas
from pdvol.integrate.integrator import State
from pdvol.integrate.stepper import Stepper
from pdvol.levels.hierarchy import Hierarchy
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.meshes import brick
from pdvol.potentials.potential import Positions
from pdvol.scene import Barrier, Body, NeoHookean, Plane, Scene, Solver, Support, Translation

RADIUS, YOUNG, POISSON = 1.0, 1e6, 0.3
SECONDS, STEPS = 1e3, 4
"""Length of a step [s], so long that inertia does not matter, and steps in which the hemisphere is pressed."""
TRIM = 0.85
"""Share of the box that is mapped onto the ball: cells at the edges of the whole box would be flat."""
DHAT = 0.6
"""Contact distance over the approach aimed at, times the cells."""
FIGURES = ("radius", "approach", "offset", "pressure")
"""In the order of HEAD."""
HEAD = ["a / R aimed at", "cells", "vertices", "h / a", "dhat / approach", "force balance"]
HEAD += ["contact radius", "approach", "approach less gap", "largest pressure", "Newton", "time [s]"]


def hemisphere(cells: int, ratio: float) -> LevelMesh:
    """The lower half of a ball of radius 1 m, trimmed at its sides, with its pole at the origin: a box of 2n x 2n x n
    cells, each of six tetrahedra, graded towards the pole and mapped onto the ball. A contact of radius `ratio` is half
    as wide as the grid.
    """
    box = brick((2.0, 2.0, 1.0), (2 * cells, 2 * cells, cells))
    t = box.vertices - [0.0, 0.0, box.vertices[:, 2].min()]
    steep = _steepness(ratio)
    p = np.sinh(steep * t) / np.sinh(steep) * [TRIM, TRIM, 1.0] - [0.0, 0.0, 1.0]
    x, y, z = (p**2).T
    p *= np.sqrt(np.column_stack([1 - (a + b) / 2 + a * b / 3 for a, b in ((y, z), (z, x), (x, y))]))
    m = len(box.cells)
    return LevelMesh(RADIUS * (p + [0.0, 0.0, 1.0]), box.cells, np.zeros(m, np.int32), np.zeros(m, np.int32))


def _steepness(ratio: float) -> float:
    """The b for which half the way of the graded coordinate, sinh(b / 2) / sinh(b), is mapped to `ratio` of the radius.
    The map onto the ball scales by TRIM / 2^(1/2) at the pole.
    """
    return 2.0 * float(np.arccosh(0.5 * TRIM / (np.sqrt(2.0) * ratio)))  # sinh(b) = 2 sinh(b / 2) cosh(b / 2)


def press(cells: int, ratio: float, dhat_share: float) -> dict:
    """Presses a hemisphere by the approach whose analytic contact radius is `ratio`, with a contact distance of so much
    of that approach; returns figures over the analytic ones for the force found.
    """
    approach = ratio**2 * RADIUS
    dhat = dhat_share * approach
    mesh = hemisphere(cells, ratio)
    mesh = LevelMesh(mesh.points + [0.0, 0.0, 1.05 * dhat], mesh.cells, mesh.bodies, mesh.regions)
    top = mesh.points[:, 2].max()
    speed = (approach + 1.05 * dhat) / (SECONDS * STEPS)
    scene = Scene(
        (Body(("hemisphere",), NeoHookean(YOUNG, POISSON, 1.0)),),
        dt=SECONDS,
        steps=STEPS,
        supports=(Support(lambda X: X[:, 2] > top - 1e-9, motion=Translation((0.0, 0.0, -speed))),),
        obstacles=(Plane((0.0,) * 3, (0.0, 0.0, 1.0)),),
        contact=(Barrier(dhat),),
        solver=Solver(tolerance=1e-5 * approach / SECONDS),
    )
    scene = first_order(scene)  # quasi-static: each step begins at rest
    begin = time.process_time()
    levels = Hierarchy([mesh], MPI.COMM_WORLD)
    model = level_model(scene, levels, 0, RADIUS, placed_obstacles(scene.obstacles, ()))
    stepper = Stepper(model, levels[0])
    state, newton = State(mesh.points, np.zeros_like(mesh.points)), 0
    for step in range(1, STEPS + 1):
        report = stepper.step(step, (state,))
        state, newton = State(report.positions, np.zeros_like(mesh.points)), newton + report.newton_iterations
        if report.reached < 1.0:
            raise Mistake(f"contact stopped the press at step {step}")
    steep = _steepness(ratio)
    return {
        "cells": cells,
        "ratio": ratio,
        "vertices": len(mesh.points),
        "h": TRIM * np.sinh(steep / cells) / np.sinh(steep) / (np.sqrt(2.0) * ratio),
        "dhat": dhat_share,
        "newton": newton,
        "seconds": time.process_time() - begin,
        **figures(stepper, mesh, report.positions, approach),
    }


def figures(stepper: Stepper, mesh: LevelMesh, x: np.ndarray, approach: float) -> dict:
    """Contact radius, approach and largest pressure over those that Hertz gives for the same force.

    The radius follows from the second moment of the contact forces, 2/5 a^2 of Hertz's, the pressure from a fit of
    p^2 = p0^2 (1 - r^2 / a^2) within 0.7 a, weighted with areas. The approach is counted from where the pole would
    touch the plane; `offset` from where it would reach the gap that the barrier leaves under it. `balance` is the
    support's force over that of contact.
    """
    space = stepper.space
    at = Positions(space, space.from_input(x).copy())
    rows = sum(term.gradient(at) for term in stepper.potential.contacts)
    forces = -space.to_input(rows)[:, 2]
    force, r2 = forces.sum(), (x[:, :2] ** 2).sum(axis=1)
    held = x[:, 2] > x[:, 2].max() - 1e-9
    support = space.to_input(sum(term.gradient(at) for term in stepper.potential.terms))[held, 2].sum()
    stiff = YOUNG / (1.0 - POISSON**2)
    a = (3.0 * force * RADIUS / (4.0 * stiff)) ** (1.0 / 3.0)
    p0 = 1.5 * force / (np.pi * a**2)
    radius = np.sqrt(2.5 * (forces @ r2) / force)
    areas = boundary_areas(LevelMesh(x, mesh.cells, mesh.bodies, mesh.regions))
    inner = (areas > 0) & (r2 < (0.7 * a) ** 2) & (x[:, 2] < 0.5 * RADIUS)
    square = (forces[inner] / areas[inner]) ** 2
    root = np.sqrt(areas[inner])
    fit = np.linalg.lstsq(np.column_stack([root, root * r2[inner]]), root * square, rcond=None)[0]
    skin = np.unique(mesh.boundary)
    gap = x[skin[x[skin, 2] < 0.5 * RADIUS], 2].min()
    return {
        "force": force,
        "balance": -support / force,
        "a": a,
        "gap": gap / (a**2 / RADIUS),
        "radius": radius / a,
        "approach": approach / (a**2 / RADIUS),
        "offset": (approach + gap) / (a**2 / RADIUS),
        "pressure": np.sqrt(fit[0]) / p0,
    }


def extrapolated(values: Sequence[float]) -> tuple[float, float]:
    """The order with which values on meshes of n, 2n and 4n cells converge, and their limit (Richardson); nan and the
    last value where they do not contract to one side.
    """
    first, second = values[-2] - values[-3], values[-1] - values[-2]
    if not first / second > 1.0:
        return float("nan"), float(values[-1])
    return float(np.log2(first / second)), float(values[-1] + second / (first / second - 1.0))


def limits(rows: list[dict]) -> list[list[str]]:
    """The cells of each ratio a / R with three doublings of cells: a / R at the limit, each figure's with its order."""
    lines = []
    for ratio in dict.fromkeys(row["ratio"] for row in rows):
        mine = [row for row in rows if row["ratio"] == ratio]
        if len(mine) < 3 or any(b["cells"] != 2 * a["cells"] for a, b in zip(mine[-3:], mine[-2:], strict=False)):
            continue
        (_, a), *found = (extrapolated([row[key] for row in mine]) for key in ("a", *FIGURES))
        lines.append([f"{ratio:g}", f"{a / RADIUS:.4f}", *(f"{limit:.4f} ({order:.3g})" for order, limit in found)])
    return lines


def cells_of(press: tuple[float, int], row: dict) -> list[list[str]]:
    """The cells of a press."""
    sizes = [
        f"{row['ratio']:g}",
        str(row["cells"]),
        f"{row['vertices']:,}",
        number(row["h"], 2),
        number(row["dhat"], 2),
    ]
    found = [f"{row['balance']:.6f}", *(f"{row[key]:.4f}" for key in FIGURES)]
    return [[*sizes, *found, str(row["newton"]), f"{row['seconds']:.1f}"]]


@command(
    "hertz",
    __doc__,
    {
        "--cells": {"default": "8,16,32", "metavar": "N,...", "help": "cells from the pole to the top"},
        "--ratios": {"default": "0.2,0.1,0.05", "metavar": "A,...", "help": "contact radius over the ball's"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "hertz"},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    try:
        cells = sorted(int(word) for word in options.cells.split(","))
        ratios = sorted((float(word) for word in options.ratios.split(",")), reverse=True)
        if cells[0] < 4 or not 0.01 <= ratios[-1] <= ratios[0] <= 0.25:
            raise ValueError("at least 4 cells, and ratios from 0.01 to 0.25")
    except ValueError as error:
        raise Mistake(str(error)) from error
    options.out.mkdir(parents=True, exist_ok=True)
    rows: list[dict] = []

    def measured(asked: tuple[float, int]) -> dict:
        ratio, n = asked
        rows.append(press(n, ratio, DHAT / n))
        return rows[-1]

    presses = table(HEAD, each(product(ratios, cells), measured, cells_of))
    head = ["a / R aimed at", "a / R", *(f"{name}, limit (order)" for name in HEAD[6:10])]
    text = f"{presses}\n\n{table(head, limits(rows))}"
    (options.out / "hertz.md").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    sys.exit(main())
