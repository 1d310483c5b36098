"""What each rule of the solver gains: scenes with one rule switched off at a time, beside all rules.

    ./run python -m benchmarks.ablation [lengthening,predictions] [--rows drop_500,stack]
    ./run python -m benchmarks.ablation meetings --picture demos/jelly_bowl.py docs/pictures/meetings.png

A cell has the Newton iterations over those with all rules, the same of conjugate gradients, and of CPU seconds. Counts
repeat; seconds scatter by 5 %, and by more beside other work. `failed` stands for a run that did not come to its end.
The picture has each step of level 0 of a scene file.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from unittest.mock import patch

from benchmarks.ablation.curves import draw_curves
from benchmarks.common import process
from benchmarks.common.process import REPOSITORY
from benchmarks.common.tables import table
from benchmarks.dense.rows import ROWS as DENSE
from pdvol import PdvolError, open_run
from pdvol.integrate.stepper import Stepper
from pdvol.potentials.contact.barrier import ContactBarrier
from pdvol.potentials.contact.friction import LaggedFriction
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.solve import newton
from pdvol.solve.linear import solver
from pdvol.solve.linear.solver import LinearSolver

ENVELOPE = (
    "young_1e2",
    "young_1e9",
    "dt_0.1",
    "impact_10000",
    "impact_sheet_100",
    "mu_10",
    "mass_ratio_1e6_heavy_above",
    "compress_99_poisson_0",
    "spin_30",
    "size_1mm",
    "size_0.1mm_thrown_dt_1e-4",
    "twist_20_turns_one_cell_thick",
)
"""Rows of benchmarks.extremes."""
SHORTER = {
    "drop_4k": 70,
    "blocks": 45,
    "stack": 60,
    "balls": 45,
    "jelly_bowl": 40,
    "twist_20_turns_one_cell_thick": 100,
}
"""Steps of scenes that take long."""
MORE = ("impact_45", "impact_100", "impact_150", "struck_15")
ROWS = (*(name for name, row in DENSE.items() if not row.long or name in MORE), *ENVELOPE)


# ---- rules


RULES: dict[str, Callable[[], AbstractContextManager]] = {
    "all": nullcontext,
    "lengthening": lambda: patch.object(newton, "step_factor", lambda *_: 1.0),
    "unprojected": lambda: patch.object(LinearSolver, "detects_indefinite", False),
    "predictions": lambda: patch.object(LaggedFriction, "predict", lambda *_: False),
    "meetings": lambda: patch.object(ContactBarrier, "predict", lambda *_: False),
    "predicted_start": lambda: patch.object(Stepper, "_predicted", lambda *_: None),
    "kept_matrix": lambda: patch.object(newton, "keeps_matrix", lambda *_: False),
    "coarse_space": lambda: patch.object(solver, "COARSE_SETUP", solver.MAX_ITERATIONS),
}
"""By name, what switches a rule off."""


# ---- runs


def march(name: str, rule: str) -> tuple[int, int, float] | None:
    """Newton iterations, those of conjugate gradients, and CPU seconds of a row without a rule; None where it fails."""
    if name in DENSE:
        file, settings, steps = DENSE[name].file, DENSE[name].settings, DENSE[name].steps
    else:
        file, settings, steps = "benchmarks/extremes/scenes.py", {"name": name}, None
    begin = time.process_time()
    try:
        log, _ = log_of(file, settings, SHORTER.get(name, steps), rule)
    except PdvolError as error:
        print(f"{name} without {rule}: {error}", file=sys.stderr)
        return None
    seconds = time.process_time() - begin
    return sum(r["newton_iterations"] for r in log), sum(r["linear_iterations"] for r in log), seconds


def log_of(file: str, settings: dict, steps: int | None, rule: str) -> tuple[list[dict], float]:
    """The log of level 0 of a scene file's run without a rule, and its dt [s]."""
    with tempfile.TemporaryDirectory() as folder, RULES[rule]():
        run_scene(load_shot(str(REPOSITORY / file), settings, steps), Path(folder) / "run", 0, 0)
        run = open_run(Path(folder) / "run")
        return list(run.levels[0].log), run.dt


def cell(found: tuple[int, int, float] | None, whole: tuple[int, int, float]) -> str:
    """The ratios of a run to that with all rules."""
    return (
        "failed" if found is None else ", ".join(f"{a / max(b, 1e-9):.2f}" for a, b in zip(found, whole, strict=True))
    )


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("ablation", __doc__)
    parser.add_argument("rules", nargs="?", default=",".join(RULES), help=", ".join(RULES))
    parser.add_argument("--rows", default=",".join(ROWS), help=", ".join(ROWS))
    parser.add_argument("--picture", nargs=2, metavar=("SCENE", "PNG"), help="draw the steps of a scene file instead")
    options = parser.parse_args(words)
    rules = [rule for rule in options.rules.split(",") if rule != "all"]
    rows = options.rows.split(",")
    unknown = [word for word in (*rules, *rows) if word not in (*RULES, *ROWS)]
    if unknown:
        print(f"benchmarks.ablation: there is no {', '.join(unknown)}", file=sys.stderr)
        return 2
    if options.picture:
        file, picture = options.picture
        found = {rule: log_of(file, {}, None, rule) for rule in reversed(["all", *rules])}
        logs = {"all rules" if rule == "all" else f"without {rule}": log for rule, (log, _) in found.items()}
        print(draw_curves(Path(picture), logs, found["all"][1]))
        return 0
    lines = []
    for name in rows:
        whole = march(name, "all")
        if whole is None:
            return 1
        counts = f"{whole[0]:,}, {whole[1]:,}, {whole[2]:.1f}"
        lines.append([name, counts, *(cell(march(name, rule), whole) for rule in rules)])
        print(" | ".join(lines[-1]), file=sys.stderr, flush=True)
    print(table(["row", "all rules", *(f"without {rule}" for rule in rules)], lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
