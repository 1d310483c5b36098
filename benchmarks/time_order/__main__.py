"""Implicit Euler and BDF2: their order in the time step, what is left of a swing, and how far shots are from the truth.

    ./run python -m benchmarks.time_order [--parts order,swings,shots,levels] [--out runs/time_order]

Distances are root mean squares over the vertices. The truth of a level is BDF2 at a tenth of the shots' time step.
Written to the folder: time_order.md.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigh

import pdvol
from benchmarks.common import process
from benchmarks.common.first_order import first_order
from benchmarks.common.process import Mistake, machine
from benchmarks.common.tables import number, table
from demos import ball_on_spike
from pdvol import Barrier, Body, Friction, Gravity, NeoHookean, Placement, Plane, Scene, Solid, Solver, Support, meshes
from pdvol.geometry.level_mesh import LevelMesh
from pdvol.integrate.marches import Start, direct
from pdvol.integrate.stepper import Stepper
from pdvol.levels.model import level_model
from pdvol.levels.space import LevelSpace
from pdvol.potentials.potential import Positions

DT, TRUTH = 0.01, 0.001
"""Time step of the shots, and of what they are compared with [s]."""
ORDER_STEPS = (0.005, 0.0025, 0.00125)
"""Time steps between which orders are measured [s]; the truth has a fifth of the last one."""
SWINGS, STEPS_A_SWING = 10, 40
NAMES = {"implicit_euler": "implicit Euler", "bdf2": "BDF2"}
G = Gravity((0.0, -9.81))


def grid(size: tuple[float, float], cuts: tuple[int, int]) -> Solid:
    """A rectangle as triangles, its lower left corner at the origin."""
    x, y = np.meshgrid(*(np.linspace(0.0, length, n + 1) for length, n in zip(size, cuts, strict=True)))
    row = cuts[0] + 1
    a = (np.arange(cuts[1])[:, None] * row + np.arange(cuts[0])).ravel()
    cells = np.vstack([np.column_stack([a, a + 1, a + row + 1]), np.column_stack([a, a + row + 1, a + row])])
    return Solid(np.column_stack([x.ravel(), y.ravel()]), cells, np.zeros(len(cells), np.int32))


def cantilever(d: int = 2, damping: float = 0.0) -> Scene:
    """A bar of 1 x 0.2 m, held at its left end, which gravity sets swinging; in 2D with three levels."""
    if d == 2:
        shapes: tuple[Solid, ...] = tuple(grid((1.0, 0.2), (10 * n, 2 * n)) for n in (1, 2, 4))
    else:
        shapes = (meshes.brick((1.0, 0.2, 0.2), (10, 2, 2)),)
    left = min(shape.vertices[:, 0].min() for shape in shapes)
    return Scene(
        bodies=(Body(shapes, NeoHookean(1e5, 0.3, 1000.0, damping=damping), name="bar"),),
        supports=(Support(lambda X: X[:, 0] < left + 1e-9),),
        loads=(Gravity((0.0, -9.81, 0.0)[:d]),),
        dt=DT,
        steps=100,
    )


def bouncing_disc(damping: float = 0.0, mu: float = 0.0) -> Scene:
    """A soft disc of 0.25 m falls from 0.6 m onto the ground, with a velocity along it, and bounces."""
    material = NeoHookean(1e5, 0.3, 1000.0, damping=damping)
    placement, speed = Placement(translate=(0.0, 0.85)), (0.5, 0.0)
    return Scene(
        bodies=(Body(meshes.disc(0.25), material, (120,), "disc", placement=placement, velocity=speed),),
        obstacles=(Plane((0.0, 0.0), (0.0, 1.0)),),
        loads=(G,),
        contact=(Barrier(), *_friction(mu)),
        dt=DT,
        steps=100,
    )


def ball(offset: float = 0.002, damping: float = 0.0) -> Scene:
    """demos/ball_on_spike.py on its coarsest level, for 0.6 s; with damping, its friction is lagged until it is right.

    At the demo's own offset the ball all but balances, and small errors decide to which side it goes.
    """
    scene = ball_on_spike.scene(offset=offset, steps=60)
    (body,) = scene.bodies
    damped = replace(body, material=replace(body.material, damping=damping))
    return replace(scene, bodies=(damped,), contact=(Barrier(), *_friction(0.3))) if damping else scene


def _friction(mu: float) -> tuple[Friction, ...]:
    """Friction, if any, with its normal forces lagged until they are right, as the order of the integrator asks for."""
    return (Friction(mu, iterations=20, tolerance=1e-4),) if mu else ()


def states(
    scene: Scene, dt: float, integrator: str, levels: int = 0, method: str = "progressive", steps: int | None = None
) -> list[dict]:
    """The motion of each level with a time step: `x` (steps, n, d) [m] at multiples of `DT`, and what it took. Of the
    scene's steps, or so many.
    """
    end = scene.dt * (scene.steps if steps is None else steps)
    scene = replace(first_order(scene), dt=dt, steps=round(end / dt), integrator=integrator)
    every = round(DT / dt) if dt < DT else 1
    found: list[dict] = []
    begin = time.process_time()
    for step in pdvol.march(scene, levels=levels, method=method):
        if step.level == len(found):
            found.append({"x": [], "newton": 0})
        mine = found[step.level]
        mine["newton"] += step.report.newton_iterations
        mine["seconds"] = time.process_time() - begin
        if step.step % every == 0:
            mine["x"].append(step.positions)
    return found


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """Root mean square distance [m] over vertices."""
    return float(np.sqrt(np.mean(np.sum((one - other) ** 2, axis=1))))


def over_shot(one: dict, other: dict) -> float:
    """Its mean over common times [m]."""
    return float(np.mean([apart(a, b) for a, b in zip(one["x"], other["x"], strict=True)]))


# ---- the parts


def orders() -> str:
    """Order in dt of the end of a cantilever's first second on level 0."""
    rows = []
    for d in (2, 3):
        scene = cantilever(d)
        end = states(scene, ORDER_STEPS[-1] / 5.0, "bdf2")[0]["x"][-1]
        for name in NAMES:
            errors = [apart(states(scene, dt, name)[0]["x"][-1], end) for dt in ORDER_STEPS]
            slope = np.polyfit(np.log(ORDER_STEPS), np.log(errors), 1)[0]
            rows.append([f"{d}D", NAMES[name], *(number(1e3 * error) for error in errors), f"{slope:.2f}"])
    return table(["cantilever", "integrator", *(f"error at {dt:g} s [mm]" for dt in ORDER_STEPS), "order"], rows)


def swings(count: int = SWINGS) -> str:
    """What is left of the amplitude of a bar's first bending mode."""
    mesh = grid((1.0, 0.2), (10, 2))
    level = LevelMesh(mesh.vertices, mesh.cells, mesh.regions, mesh.regions)
    scene = replace(first_order(cantilever()), loads=(), solver=Solver(tolerance=1e-9, linear="direct"))
    stepper = _stepper(scene, level)
    free = level.points[:, 0] > 1e-9
    mass = np.repeat(stepper.space.to_input(stepper.potential.mass)[free, 0], 2)

    def force(free_move: np.ndarray) -> np.ndarray:
        x = level.points.copy()
        x[free] += free_move.reshape(-1, 2)
        at = Positions(stepper.space, stepper.space.from_input(x))
        return stepper.space.to_input(-sum(term.gradient(at) for term in stepper.potential.terms))[free].ravel()

    h, unit = 1e-6, np.eye(len(mass))
    stiffness = np.array([(force(-h * row) - force(h * row)) / (2.0 * h) for row in unit])
    squares, modes = eigh((stiffness + stiffness.T) / 2.0, np.diag(mass))
    omega, mode = float(np.sqrt(squares[0])), modes[:, 0]
    velocity = np.zeros_like(level.points)
    velocity[free] = (1e-3 * omega * mode / np.abs(mode).max()).reshape(-1, 2)
    turn, steps = 2.0 * np.pi / STEPS_A_SWING, count * STEPS_A_SWING
    z = [1.0, 1.0 / (1.0 - 1j * turn)]  # both of z' = i z, which begin with a step of implicit Euler
    for _ in range(steps - 1):
        z.append((4.0 * z[-1] - z[-2]) / (3.0 - 2j * turn))
    expected = {"implicit_euler": abs(z[1]) ** steps, "bdf2": abs(z[-1])}
    rows = []
    for name in NAMES:
        stepper = _stepper(replace(scene, dt=turn / omega, steps=steps, integrator=name), level)
        for report in direct(stepper, Start.at_rest(level.points, velocity), steps):
            moved, speed = (report.positions - level.points)[free].ravel(), report.velocity[free].ravel()
        # In the mode's own coordinate, whose mass is one, an amplitude is that of q and q' / omega together.
        left = np.hypot(mode @ (mass * moved) * omega, mode @ (mass * speed))
        whole = mode @ (mass * velocity[free].ravel())
        rows.append([NAMES[name], f"{left / whole:.2%}", f"{expected[name]:.2%}"])
    return table(["integrator", f"left after {count} swings of {STEPS_A_SWING} steps", "by its formula"], rows)


def _stepper(scene: Scene, level: LevelMesh) -> Stepper:
    model = level_model(scene, level, 0, 1.0, ())
    return Stepper(model, LevelSpace(level, MPI.COMM_SELF))


def shots() -> str:
    """Mean distance over a shot on level 0 from its truth."""
    made = {
        "cantilever": cantilever(),
        "cantilever, damping": cantilever(damping=0.02),
        "disc that bounces": bouncing_disc(),
        "disc that bounces, damping, friction": bouncing_disc(damping=0.005, mu=0.3),
        "ball_on_spike as it is": ball(),
        "ball_on_spike, damping, 1 cm off the axis": ball(0.01, 0.01),
    }
    rows = []
    for label, scene in made.items():
        (truth,) = states(scene, TRUTH, "bdf2")
        row, newton = [], []
        for name, dt in (("implicit_euler", DT), ("bdf2", DT), ("implicit_euler", TRUTH)):
            (found,) = states(scene, dt, name)
            row.append(number(1e3 * over_shot(found, truth)))
            newton.append(str(found["newton"]))
        rows.append([label, *row, " / ".join(newton[:2])])
    head = ["level 0", "implicit Euler [mm]", "BDF2 [mm]", f"implicit Euler at {TRUTH:g} s [mm]", "Newton"]
    return table(head, rows)


def levels() -> str:
    """A cantilever's three levels, each beside itself at a tenth of the time step."""
    rows = []
    for method in ("progressive", "direct"):
        scene = cantilever()
        for name in NAMES:
            found, truths = states(scene, DT, name, 2, method), states(scene, TRUTH, name, 2, method)
            level_0 = states(scene, TRUTH, "bdf2")[0]["x"]
            for level, (mine, truth) in enumerate(zip(found, truths, strict=True)):
                centres = [np.linalg.norm(a.mean(0) - b.mean(0)) for a, b in zip(mine["x"], level_0, strict=True)]
                ends = [
                    1e3 * apart(mine["x"][-1], truth["x"][-1]),
                    1e3 * over_shot(mine, truth),
                    1e3 * np.mean(centres),
                ]
                rows.append([method, NAMES[name], str(level), *map(number, ends), str(mine["newton"])])
    return table(
        [
            "method",
            "integrator",
            "level",
            f"end from that at {TRUTH:g} s [mm]",
            "the same over the shot [mm]",
            "centre from level 0's truth, over the shot [mm]",
            "Newton",
        ],
        rows,
    )


PARTS: dict[str, Callable[[], str]] = {
    "order": orders,
    "swings": swings,
    "shots": shots,
    "levels": levels,
}


def main(words: list[str]) -> int:
    """Runs the parts asked for, and prints and keeps their tables."""
    parser = process.parser("time_order", __doc__)
    parser.add_argument("--parts", default=",".join(PARTS), help=f"some of {', '.join(PARTS)} (default: all)")
    parser.add_argument("--out", type=Path, default=Path("runs/time_order"))
    options = parser.parse_args(words)
    try:
        wanted = options.parts.split(",")
        for part in wanted:
            if part not in PARTS:
                raise Mistake(f"there is no part {part!r}; there are {', '.join(PARTS)}")
        options.out.mkdir(parents=True, exist_ok=True)
    except (Mistake, OSError) as error:
        print(f"benchmarks.time_order: {error}", file=sys.stderr)
        return 2
    texts = [f"{machine()['processor']}, one thread."]
    for part in wanted:
        begin = time.process_time()
        texts.append(PARTS[part]())
        print(f"{texts[-1]}\n", flush=True)
        print(f"{part}: {time.process_time() - begin:.0f} s", file=sys.stderr, flush=True)
    (options.out / "time_order.md").write_text("\n\n".join(texts) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
