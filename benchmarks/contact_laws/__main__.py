"""The three contact laws compared, and the convergence of a resting block: the tables of docs/contact.md.

    ./run python -m benchmarks.contact_laws [--json FILE]

The scenes are a cube at rest on a plane at several resolutions, the same cube thrown at the plane with an edge first,
and a stiff, heavy block on a soft one. Gaps are in units of dhat.
"""

import json
import time
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.optimize import brentq

from benchmarks.common import process
from pdvol.errors import PdvolError
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.integrate.integrator import State
from pdvol.integrate.stepper import Stepper
from pdvol.levels.model import level_model
from pdvol.levels.obstacles import placed_obstacles
from pdvol.levels.space import LevelSpace
from pdvol.meshes import brick
from pdvol.potentials.contact import barrier_law
from pdvol.scene import LAWS, Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, Solver

G, DHAT, SIDE = 9.81, 2e-3, 0.2
SOFT = NeoHookean(1e5, poisson=0.3, density=1000.0)
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
WEIGHT = SOFT.density * G * SIDE
"""What the resting cube presses with [Pa]."""


def march(bodies, law: str, steps: int, dt: float, velocity, friction=()) -> dict:
    """Marches bodies (Solid, material, Placement) above the floor: mesh, reports, last velocities, seconds a step."""
    scene = Scene(
        tuple(Body((solid,), material, name=f"body {i}") for i, (solid, material, _) in enumerate(bodies)),
        dt=dt,
        steps=steps,
        loads=(Gravity((0.0, -G, 0.0)),),
        obstacles=(FLOOR,),
        contact=(Barrier(dhat=DHAT, law=law), *friction),
        solver=Solver(tolerance=1e-5),
    )
    offsets = np.cumsum([0, *(len(solid.vertices) for solid, _, _ in bodies)])
    cells = np.concatenate(
        [solid.cells + offset for (solid, _, _), offset in zip(bodies, offsets, strict=False)]
    ).astype(np.int64)
    owners = np.repeat(np.arange(len(bodies), dtype=np.int32), [len(solid.cells) for solid, _, _ in bodies])
    mesh = LevelMesh(
        np.concatenate([placed(solid.vertices) for solid, _, placed in bodies]),
        cells,
        owners,
        np.zeros(len(cells), dtype=np.int32),
    )
    problem = Stepper(
        level_model(scene, mesh, 0, 1.0, placed_obstacles(scene.obstacles)), LevelSpace(mesh, MPI.COMM_SELF)
    )
    x, v, reports, start = (
        mesh.points,
        np.tile(np.asarray(velocity, dtype=float), (len(mesh.points), 1)),
        [],
        time.perf_counter(),
    )
    for number in range(1, steps + 1):
        reports.append(problem.step(number, (State(x, v),)))
        v, x = (reports[-1].positions - x) / dt, reports[-1].positions
    return {"mesh": mesh, "reports": reports, "seconds": (time.perf_counter() - start) / steps}


def effort(done: dict) -> dict:
    """Iterations, cuts, gaps and seconds of a march."""
    newton = [report.newton_iterations for report in done["reports"]]
    kappas = [report.kappa for report in done["reports"]]
    return {
        "newton": float(np.mean(newton)),
        "most": max(newton),
        "cuts": sum(report.cuts for report in done["reports"]),
        "smallest": min(report.min_gap for report in done["reports"] if report.min_gap is not None) / DHAT,
        "kappa": [min(kappas), max(kappas)],
        "seconds": done["seconds"],
    }


def rest(law: str, n: int, start: float = 0.9) -> dict:
    """A cube of n cells a side comes to rest from `start` dhat above the floor."""
    cube = brick((SIDE,) * 3, (n,) * 3)
    done = march([(cube, SOFT, Placement((0.0, 0.5 * SIDE + start * DHAT, 0.0)))], law, 40, 0.02, (0.0, 0.0, 0.0))
    mesh, x = done["mesh"], done["reports"][-1].positions
    low = mesh.points[:, 1] < start * DHAT + 1e-9
    facets = mesh.boundary[low[mesh.boundary].all(axis=1)]
    areas = np.bincount(facets.ravel(), minlength=len(low))[low] / facets.size
    gaps = x[low, 1] / DHAT
    pressures = barrier_law.pressure(gaps**2, DHAT, Barrier().stiffness * SOFT.young) / WEIGHT
    spread = float(np.sqrt(np.average((pressures - 1.0) ** 2, weights=areas)))
    mean_gap, mean_pressure = (float(np.average(values, weights=areas)) for values in (gaps, pressures))
    return {"n": n, "gap": mean_gap, "pressure": mean_pressure, "spread": spread, **effort(done)}


def impact(law: str) -> dict:
    """The cube hits the floor with an edge at 10 m/s."""
    return effort(
        march(
            [(brick((SIDE,) * 3, (4,) * 3), SOFT, Placement((0.0, 0.2, 0.0), 0.6, (0.3, 0.1, 1.0)))],
            law,
            30,
            5e-3,
            (2.0, -10.0, 0.0),
            (Friction(0.3),),
        )
    )


def stack(law: str) -> dict:
    """A block a million times as stiff and eight times as heavy falls onto the soft cube by a fifth of its side."""
    stiff = NeoHookean(1e11, poisson=0.3, density=8000.0)
    bodies = [
        (brick((SIDE,) * 3, (4,) * 3), SOFT, Placement((0.0, 0.5 * SIDE + 0.9 * DHAT, 0.0))),
        (brick((0.6 * SIDE,) * 3, (2,) * 3), stiff, Placement((0.01, 1.5 * SIDE, 0.013), 0.2, (0.0, 1.0, 0.0))),
    ]
    return effort(march(bodies, law, 40, 0.01, (0.0, 0.0, 0.0), (Friction(0.3),)))


def attempt(scene, *arguments) -> dict:
    """The result of a scene, or the error that ended it."""
    try:
        return scene(*arguments)
    except PdvolError as error:
        return {"failed": str(error)}


def effort_row(name: str, law: str, row: dict) -> str:
    """A row of the table of efforts."""
    if "failed" in row:
        return f"| {name} | {law} | {row['failed']} | | | | |"
    kappas = (
        "constant"
        if row["kappa"][0] == row["kappa"][1]
        else f"changes by {row['kappa'][1] / row['kappa'][0]:.3g} times"
    )
    return (
        f"| {name} | {law} | {row['newton']:.1f} ({row['most']}) | {row['cuts']} | {row['smallest']:.3f} | {kappas} |"
        f" {row['seconds']:.3f} |"
    )


def main() -> None:
    """Prints the tables."""
    parser = process.parser("contact_laws", __doc__)
    parser.add_argument("--json", help="write all figures there, too")
    options, out = parser.parse_args(), {}
    ideal = brentq(
        lambda y: float(barrier_law.pressure(np.array(y * y), DHAT, Barrier().stiffness * SOFT.young)) - WEIGHT,
        1e-3,
        1.0 - 1e-9,
    )
    print(f"By hand: pressure {WEIGHT:.0f} Pa, gap {ideal:.4f} dhat.\n")
    print(
        "| cells a side | gap [dhat]: convergent | mean pressure / weight | its spread | gap [dhat]: classic"
        " | classic, from 0.6 dhat [dhat] | gap [dhat]: semi-implicit |"
    )
    print("|---|---|---|---|---|---|---|")
    for n in (1, 2, 4, 8):
        rows = {law: attempt(rest, law, n) for law in LAWS} | {"lower": attempt(rest, "classic", n, 0.6)}
        out[f"rest {n}"] = rows
        first, *others = rows.values()
        told = " | ".join(
            f"{row['gap']:.4f}" if "gap" in row else row["failed"] for row in (others[0], others[2], others[1])
        )
        print(f"| {n} | {first['gap']:.4f} | {first['pressure']:.3f} | {first['spread']:.2f} | {told} |", flush=True)
    print(
        "\n| scene | law | Newton iterations a step, mean (most) | cut steps | smallest gap / dhat | stiffness |"
        " time a step [s] |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, scene in (("impact", impact), ("stack", stack)):
        for law in LAWS:
            out[f"{name} {law}"] = row = attempt(scene, law)
            print(effort_row(name, law, row), flush=True)
    if options.json:
        Path(options.json).write_text(json.dumps(out, indent=1))


if __name__ == "__main__":
    main()
