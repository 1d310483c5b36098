"""What each rule of the solver gains: scenes with one rule switched off at a time, beside all rules.

    ./run python -m benchmarks.ablation [lengthening,predictions] [--rows drop_500,stack]

A cell has the Newton iterations over those with all rules, the same of conjugate gradients, and of CPU seconds. Counts
repeat; seconds scatter by 5 %, and by more beside other work. `failed` stands for a run that did not come to its end.
"""

import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from unittest.mock import patch

from benchmarks.common import rows
from benchmarks.common.process import REPOSITORY, Failure
from benchmarks.common.rows import EVERYDAY, EXTREMES, ROWS
from benchmarks.common.study import command, each
from benchmarks.common.tables import table
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
)
ENVELOPE += (
    "compress_99_poisson_0",
    "spin_30",
    "size_1mm",
    "size_0.1mm_thrown_dt_1e-4",
    "twist_20_turns_one_cell_thick",
)
"""Rows of benchmarks.extremes."""
SHORTER = {"drop_4k": 70, "blocks": 45, "stack": 60, "balls": 45, "jelly_bowl": 40}
SHORTER |= {"twist_20_turns_one_cell_thick": 100}
"""Steps of scenes that take long."""
KNOWN = {**ROWS, **{name: rows.scene(name, None, EXTREMES) for name in ENVELOPE}}
USUAL = (*EVERYDAY, "impact_45", "impact_100", "impact_150", "struck_15", *ENVELOPE)
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


def march(name: str, rule: str) -> tuple[int, int, float] | None:
    """Newton iterations, those of conjugate gradients, and CPU seconds of a row without a rule; None where it fails."""
    row, begin = KNOWN[name], time.process_time()
    try:
        shot = load_shot(str(REPOSITORY / row.file), row.settings, SHORTER.get(name, row.steps))
        with tempfile.TemporaryDirectory() as folder, RULES[rule]():
            run_scene(shot, Path(folder) / "run", 0, 0)
            log = list(open_run(Path(folder) / "run").levels[0].log)
    except PdvolError as error:
        print(f"{name} without {rule}: {error}", file=sys.stderr)
        return None
    seconds = time.process_time() - begin
    return sum(r["newton_iterations"] for r in log), sum(r["linear_iterations"] for r in log), seconds


def cell(found: tuple[int, int, float] | None, whole: tuple[int, int, float]) -> str:
    """The ratios of a run to that with all rules."""
    if found is None:
        return "failed"
    return ", ".join(f"{a / max(b, 1e-9):.2f}" for a, b in zip(found, whole, strict=True))


@command(
    "ablation",
    __doc__,
    {
        "rules": {"nargs": "?", "default": "", "help": ", ".join(RULES)},
        "--rows": {**rows.NAMES, "help": ", ".join(KNOWN)},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    rules = [rule for rule in rows.chosen(options.rules, RULES) if rule != "all"]

    def measured(name: str) -> dict:
        found = {rule: march(name, rule) for rule in ("all", *rules)}
        if found["all"] is None:
            raise Failure(f"{name} fails with all rules")
        return found

    def cells(name: str, found: dict) -> list[list[str]]:
        whole = found["all"]
        counts = f"{whole[0]:,}, {whole[1]:,}, {whole[2]:.1f}"
        return [[name, counts, *(cell(found[rule], whole) for rule in rules)]]

    lines = each(rows.chosen(options.rows, KNOWN, USUAL), measured, cells)
    print(table(["row", "all rules", *(f"without {rule}" for rule in rules)], lines))


if __name__ == "__main__":
    sys.exit(main())
