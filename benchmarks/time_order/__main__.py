"""Implicit Euler and BDF2: their order in the time step, and how far levels are from the truth.

    ./run python -m benchmarks.time_order [--parts order,levels] [--out runs/time_order]

Distances are root mean squares over the vertices. The truth of a level is BDF2 at a tenth of the shots' time step.
Written to the folder: time_order.md.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

import pdvol
from benchmarks.common.process import machine
from benchmarks.common.rows import chosen
from benchmarks.common.scenes import first_order, grid
from benchmarks.common.study import command
from benchmarks.common.tables import number, table
from pdvol import Body, Gravity, NeoHookean, Scene, Support, meshes

DT, TRUTH = 0.01, 0.001
"""Time step of the shots, and of what they are compared with [s]."""
ORDER_STEPS = (0.005, 0.0025, 0.00125)
"""Time steps between which orders are measured [s]; the truth has a fifth of the last one."""
NAMES = {"implicit_euler": "implicit Euler", "bdf2": "BDF2"}


def cantilever(d: int = 2) -> Scene:
    """A bar of 1 x 0.2 m, held at its left end, which gravity sets swinging; in 2D with three levels."""
    flat = tuple(grid((1.0, 0.2), (10 * n, 2 * n)) for n in (1, 2, 4))
    shapes = flat if d == 2 else (meshes.brick((1.0, 0.2, 0.2), (10, 2, 2)),)
    left = min(shape.vertices[:, 0].min() for shape in shapes)
    return Scene(
        bodies=(Body(shapes, NeoHookean(1e5, 0.3), name="bar"),),
        supports=(Support(lambda X: X[:, 0] < left + 1e-9),),
        loads=(Gravity((0.0, -9.81, 0.0)[:d]),),
        dt=DT,
        steps=100,
    )


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
    for step in pdvol.march(scene, levels=levels, method=method):
        if step.level == len(found):
            found.append({"x": [], "newton": 0})
        mine = found[step.level]
        mine["newton"] += step.report.newton_iterations
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
                ends = (apart(mine["x"][-1], truth["x"][-1]), over_shot(mine, truth), np.mean(centres))
                cells = [number(1e3 * end) for end in ends]
                rows.append([method, NAMES[name], str(level), *cells, str(mine["newton"])])
    head = ["method", "integrator", "level", f"end from that at {TRUTH:g} s [mm]", "the same over the shot [mm]"]
    return table([*head, "centre from level 0's truth, over the shot [mm]", "Newton"], rows)


PARTS: dict[str, Callable[[], str]] = {"order": orders, "levels": levels}


@command(
    "time_order",
    __doc__,
    {
        "--parts": {"default": ",".join(PARTS), "help": f"some of {', '.join(PARTS)} (default: all)"},
        "--out": {"type": Path, "default": Path("runs/time_order")},
    },
)
def main(options) -> None:
    """Runs the parts asked for, and prints and keeps their tables."""
    texts = [f"{machine()['processor']}, one thread."]
    options.out.mkdir(parents=True, exist_ok=True)
    for part in chosen(options.parts, PARTS):
        texts.append(PARTS[part]())
        print(f"{texts[-1]}\n", flush=True)
    (options.out / "time_order.md").write_text("\n\n".join(texts) + "\n")


if __name__ == "__main__":
    sys.exit(main())
