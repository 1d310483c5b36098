"""Which defaults give the smaller error at equal CPU time, on the scenes of benchmarks.fronts.

    ./run python -m benchmarks.defaults [time,space,both,feedback] [--scenes spike,drop] [--out runs/defaults]

- time: implicit Euler and BDF2 at 2, 1, 1/2 and 1/4 of the scene's time step, on level 0 with linear elements. The
  reference is BDF2 at an eighth of it with a tenth of the tolerance.
- space: linear and smoothed elements on levels 0, 1 and 2, each simulated alone with BDF2. The reference is smoothed
  elements on the level above.
- both: implicit Euler with linear elements at 1, 1/2 and 1/4 of the scene's time step, BDF2 with smoothed ones at 4, 2,
  1 and 1/2 of it, on the same levels. The reference is smoothed elements on the level above, BDF2 at a quarter of the
  time step with a tenth of the tolerance.
- feedback: distances between levels, continuity, and how rough level 1 is beside level 0, with the feedback's values.

Errors are root mean squares over mass and time [m]. "At equal time" reads the error of the second setting from the line
through its points in a plot of logarithms, at the CPU time of the first one. Finished runs in `--out` are used again.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.common import process
from benchmarks.common.first_order import FIRST_ORDER
from benchmarks.common.process import REPOSITORY
from benchmarks.common.tables import number, table
from pdvol import PdvolError, open_run
from pdvol.runs.run_metrics import measure_run
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import Run
from pdvol.studio.study.reference import ReferenceStates, cost
from pdvol.studio.variations.variation import Base, Variation, times


@dataclass(frozen=True)
class Shot:
    """A scene, and how long it is followed.

    Attributes
    ----------
    file : scene file
    duration : [s], before chaos decides in those scenes where it does
    settings : (name, value)
    space : levels that the comparison of elements has
    """

    file: str
    duration: float
    settings: tuple[tuple[str, object], ...] = ()
    space: int = 3


SCENES = {
    "spike": Shot("demos/ball_on_spike.py", 0.6),
    "drop": Shot("demos/drop.py", 0.6, space=2),
    "ape": Shot("demos/ape.py", 2.0),
    "twist": Shot("demos/twist.py", 1.0, space=1),
    "heterogeneous": Shot("demos/heterogeneous.py", 0.6),
    "rope": Shot("demos/rope_drop.py", 0.6),
    "sliding_block": Shot("benchmarks/fronts/sliding_block.py", 1.0, space=2),
    "tower": Shot("benchmarks/fronts/tower.py", 1.0, space=1),
}
FACTORS = (2.0, 1.0, 0.5, 0.25)  # of the scene's time step
FINEST = 0.125  # of the scene's time step: the reference's
STRICT = 0.1  # of the scene's tolerance: the reference's
INTEGRATORS = ("implicit_euler", "bdf2")
ELEMENTS = ("linear", "smoothed")
FEEDBACKS = (0.0, 0.05, 0.1, 0.2)
OLD = FIRST_ORDER, (1.0, 0.5, 0.25)  # settings, factors of the time step
NEW = {"integrator": "bdf2", "elements": "smoothed"}, (4.0, 2.0, 1.0, 0.5)
Point = tuple[float, float]
"""CPU time [s] and error [m]."""


class Runs:
    """Runs of one scene, kept in a folder.

    Parameters
    ----------
    name : of the scene
    out : folder
    """

    def __init__(self, name: str, out: Path):
        self.shot, self._out = SCENES[name], out / name
        self._file = REPOSITORY / self.shot.file
        own = Base.of(load_shot(self._file, dict(self.shot.settings)))
        self.base = Base(own.scene, own.settings, self.shot.duration, own.dt)
        self.tolerance = load_shot(self._file).scene.solver.tolerance

    def run(self, levels: tuple[int, int], method: str = "progressive", **changes: object) -> Run:
        """The finished run of levels (first, last) with changed settings."""
        variation = Variation.of(changes, method)
        folder = self._out / f"{variation.name}_levels_{levels[0]}_{levels[1]}"
        shot = load_shot(self._file, {**dict(self.base.settings), **changes}, variation.steps(self.base))
        resume = (folder / "run.json").exists()
        run_scene(shot, folder, *levels, method=method, resume=resume, xdmf=False)
        return open_run(folder)


def main(words: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("defaults", __doc__)
    parser.add_argument("parts", nargs="?", default=",".join(PARTS), help=", ".join(PARTS))
    parser.add_argument("--scenes", default=",".join(SCENES), help=", ".join(SCENES))
    parser.add_argument("--out", type=Path, default=Path("runs/defaults"))
    options = parser.parse_args(words)
    parts, names = options.parts.split(","), options.scenes.split(",")
    unknown = [word for word in (*parts, *names) if word not in (*PARTS, *SCENES)]
    if unknown:
        print(f"benchmarks.defaults: there is no {', '.join(unknown)}", file=sys.stderr)
        return 2
    for part in parts:
        head, row = PARTS[part]
        rows = []
        for name in names:
            try:
                rows.append([name, *row(Runs(name, options.out))])
            except PdvolError as error:
                rows.append([name, str(error)])
            print(" | ".join(rows[-1]), file=sys.stderr, flush=True)
        print(f"{table(head, rows)}\n")
    return 0


def time_row(runs: Runs) -> list[str]:
    """Errors of both integrators at each time step, and BDF2's at the time that implicit Euler takes."""
    strict = {"dt": times(runs.base.dt, FINEST), "tolerance": times(runs.tolerance, STRICT)}
    reference = ReferenceStates(runs.run((0, 0), integrator="bdf2", elements="linear", **strict), 0)
    half = runs.run((0, 0), integrator="bdf2", elements="linear", **{**strict, "dt": times(runs.base.dt, 2.0 * FINEST)})
    own = reference.errors(half, 0)["time"]
    found: dict[str, list[Point]] = {}
    for integrator in INTEGRATORS:
        for factor in FACTORS:
            run = runs.run((0, 0), integrator=integrator, elements="linear", dt=times(runs.base.dt, factor))
            found.setdefault(integrator, []).append((cost(run, [0])["cpu"], reference.errors(run, 0)["time"]))
    ours, theirs = (found[integrator] for integrator in INTEGRATORS)
    cells = [f"{number(1e3 * a[1])}, {number(1e3 * b[1])}" for a, b in zip(ours, theirs, strict=True)]
    return [number(1e3 * own), *cells, *at_equal(ours, theirs, FACTORS.index(1.0))]


def space_row(runs: Runs) -> list[str]:
    """Errors of both elements on each level, and those of smoothed ones at the time that linear ones take."""
    levels = runs.shot.space
    alone = lambda level, elements: runs.run((level, level), "direct", elements=elements, integrator="bdf2")
    reference = ReferenceStates(alone(levels, "smoothed"), levels)
    found: dict[str, list[Point]] = {}
    for elements in ELEMENTS:
        for level in range(levels):
            run = alone(level, elements)
            found.setdefault(elements, []).append((cost(run, [level])["cpu"], reference.errors(run, level)["time"]))
    ours, theirs = (found[elements] for elements in ELEMENTS)
    cells = [f"{number(1e3 * a[1])}, {number(1e3 * b[1])}" for a, b in zip(ours, theirs, strict=True)]
    return ["; ".join(cells), *at_equal(ours, theirs, 0)]


def both_row(runs: Runs) -> list[str]:
    """For each old setting on its front: CPU time, error, and the cheapest new setting that is as near."""
    levels, dt = runs.shot.space, runs.base.dt
    strict = {"dt": times(dt, NEW[1][-1] / 2.0), "tolerance": times(runs.tolerance, STRICT)}
    reference = ReferenceStates(runs.run((levels, levels), "direct", **NEW[0], **strict), levels)

    def points(settings: dict, factors: Sequence[float]) -> list[tuple[float, float, str]]:
        found = []
        for level in range(levels):
            for factor in factors:
                run = runs.run((level, level), "direct", **settings, dt=times(dt, factor))
                seconds, error = cost(run, [level])["cpu"], reference.errors(run, level)["time"]
                found.append((seconds, error, f"level {level}, {factor:g} dt"))
        return sorted(found)

    old, new = points(*OLD), points(*NEW)
    cells, ratios, best = [], [], np.inf
    for seconds, error, name in old:
        if error < best:
            best = error
            fit = next((point for point in new if point[1] <= error), None)
            ratios.append(np.inf if fit is None else fit[0] / seconds)
            there = "none" if fit is None else f"{number(fit[0])} s, {fit[2]}: {ratios[-1]:.2f}"
            cells.append(f"{name}: {number(seconds)} s, {number(1e3 * error)} mm; {there}")
    return ["<br>".join(cells), f"{np.median(ratios):.2f}"]


def feedback_row(runs: Runs) -> list[str]:
    """The distance between levels, the continuity's error, roughness over level 0's and iterations, by feedback."""
    cells = []
    for feedback in FEEDBACKS:
        run = runs.run((0, 1), integrator="bdf2", elements="smoothed", feedback=feedback)
        reference = ReferenceStates(run, 1)
        drift = reference.errors(run, 0)["time"]
        level = measure_run(run.path)["levels"][1]
        newton = sum(record["newton_iterations"] for record in run.levels[1].log)
        continuity = number(level["summary"]["continuity_error"]["median"])
        cells.append(f"{number(1e3 * drift)}, {continuity}, {level['rougher']:.2f}, {newton:,}")
    return cells


def at_equal(ours: Sequence[Point], theirs: Sequence[Point], index: int) -> list[str]:
    """The second setting's error over the first one's, at the CPU time of the first one's point `index`; and its CPU
    time over that, where it has this point's error.
    """
    seconds, error = ours[index]
    cpu, errors = np.log(np.array(sorted(theirs))).T
    there = float(np.exp(np.interp(np.log(seconds), cpu, errors)))
    order = np.argsort(errors)
    needed = float(np.exp(np.interp(np.log(error), errors[order], cpu[order])))
    return [f"{there / error:.2f}", f"{needed / seconds:.2f}"]


PARTS = {
    "time": (
        [
            "scene",
            "the reference's own error [mm]",
            *(f"{factor:g} dt: implicit Euler, BDF2 [mm]" for factor in FACTORS),
            "error at equal time",
            "time at equal error",
        ],
        time_row,
    ),
    "space": (
        ["scene", "each level: linear, smoothed [mm]", "error at equal time", "time at equal error"],
        space_row,
    ),
    "both": (
        ["scene", "old settings: CPU, error; cheapest new ones as near: CPU, their time over the old one's", "median"],
        both_row,
    ),
    "feedback": (
        [
            "scene",
            *(f"feedback {value:g}: distance [mm], continuity [kg m^2], roughness, Newton" for value in FEEDBACKS),
        ],
        feedback_row,
    ),
}


if __name__ == "__main__":
    sys.exit(main())
