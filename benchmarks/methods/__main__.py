"""Compares methods, interpolants and weights on a demo: runs its cases, prints a Markdown table of them and draws a
figure.

    ./run python -m benchmarks.methods rope_drop slit_array [--only WORDS] [--steps N] [--levels N] [--docs] [--out DIR]

Runs, tables (NAME.md), numbers (NAME.json) and figures (NAME.png) go to the folder `--out`; finished runs there are
used again. With `--docs` figures go to docs/pictures/methods_NAME.png. Intersections are counted by `pdvol verify`,
which is independent of the solver. The exit code is 2 for a wrong command line.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks.common.process import REPOSITORY, Mistake
from benchmarks.common.study import command, each
from benchmarks.common.tables import number, table
from benchmarks.methods.figures import METRICS, draw
from benchmarks.methods.studies import DEMOS, STUDIES, Case, Study
from pdvol import open_run
from pdvol.measure import verify
from pdvol.runs.run_metrics import measure_run
from pdvol.runs.runner import run_scene
from pdvol.runs.scene_file import load_shot
from pdvol.store.files import write_json

HEAD = ["method", "interpolant", "continuity n mean (median)", "continuity error [kg m²]", "consistency [kg m²]"]
HEAD += ["distance from P x_c [m]", "roughness [m]", "states with intersections (pairs)", "largest change of volume"]
HEAD += ["smallest det F", "CPU time [s]"]


@command(
    "methods",
    __doc__,
    {
        "studies": {"nargs": "+", "choices": sorted(STUDIES), "metavar": "STUDY", "help": ", ".join(STUDIES)},
        "--steps": {"type": int, "help": "instead of the study's"},
        "--levels": {"type": int, "help": "only so many of the coarsest levels"},
        "--only": {"default": "", "metavar": "WORDS", "help": "only the cases whose name has these words in it"},
        "--docs": {"action": "store_true", "help": "figures go to docs/pictures"},
        "--out": {"type": Path, "default": Path("runs/methods")},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    for name in options.studies:
        study(name, options)


def study(name: str, options) -> None:
    """One study: its runs, its table, its figure."""
    chosen, out = STUDIES[name], options.out
    cases = {case.name: case for case in chosen.cases if options.only in case.name}
    if not cases:
        raise Mistake(f"no case of {name} has {options.only!r} in its name: {', '.join(x.name for x in chosen.cases)}")
    paths = {case: out / name / case.replace(" ", "_") for case in cases}
    records = []

    def measured(case: str) -> dict:
        run(chosen, cases[case], paths[case], options)
        records.append(judge(paths[case], cases[case], options.levels or chosen.levels))
        return records[-1]

    text = table(HEAD, each(cases, measured, cells)) + "\n"
    write_json(out / f"{name}.json", {"study": name, "cases": records})
    (out / f"{name}.md").write_text(text)
    print(f"{name}\n\n{text}")
    figure = REPOSITORY / f"docs/pictures/methods_{name}.png" if options.docs else out / f"{name}.png"
    draw(figure, chosen, records, list(paths.values()))


def run(chosen: Study, case: Case, path: Path, options) -> None:
    """Simulates a case, or the steps that are missing."""
    settings = {**chosen.settings, **case.settings}
    shot = load_shot(DEMOS / f"{chosen.demo}.py", settings, options.steps or chosen.steps)
    levels = options.levels or chosen.levels
    stored = open_run(path).levels if (path / "run.json").is_file() else ()
    if not (len(stored) >= levels and all(level.steps > shot.scene.steps for level in stored[:levels])):
        run_scene(shot, path, 0, levels - 1, case.method, case.prolongation, resume=True)


def judge(path: Path, case: Case, count: int) -> dict:
    """Findings about one run: metrics of its `count` coarsest levels, and defects of their states."""
    result, stored, levels = measure_run(path), open_run(path), []
    for entry, level, found in zip(result["levels"][:count], stored.levels, verify.check_levels(path), strict=False):
        record = {key: entry.get(key) for key in ("level", "summary", *METRICS)} | {"vertices": len(level.rest)}
        record["seconds"] = sum(r["seconds"]["cpu"] for r in level.log)
        record |= {"states": found.steps, "crossings": found.crossings, "smallest_det": found.smallest_det}
        record["crossing_states"] = sum(" intersections: " in problem for problem in found.problems)
        levels.append(record | {"volume_change": volume_change(level)})
    return {
        "name": case.name,
        "method": case.method,
        "prolongation": case.prolongation,
        "settings": dict(case.settings),
        "notes": result["notes"],
        "dt": stored.dt,
        "seconds": sum(r["seconds"] for r in levels),
        "levels": levels,
    }


def volume_change(level) -> float:
    """The largest change of a body's volume in any state, as a share of it."""
    states = (level.rest, *(level.positions(step) for step in range(level.steps)))
    found = [np.bincount(level.bodies, verify.signed_volumes(x, level.cells)) for x in states]
    return float(np.abs(np.array(found) / found[0] - 1).max())


def cells(name: str, record: dict) -> list[list[str]]:
    """The row of a case: its finest level; intersections of all levels above the coarsest."""
    finest, above = record["levels"][-1], record["levels"][1:]
    s, n = finest["summary"], finest["summary"].get("continuity") or {}
    counted = [sum(x[key] for x in above) for key in ("crossing_states", "states", "crossings")]
    measures = ("continuity_error", "consistency", "distance", "roughness")
    row = [
        ", ".join([record["method"], *(f"{key} {value:g}" for key, value in record["settings"].items())]),
        record["prolongation"] if record["method"] != "direct" else "-",
        f"{n['mean']:.2g} ({n['median']:.2g})" if n else "-",
        *(number(s[key]["mean"], 2) if s.get(key) else "-" for key in measures),
        f"{counted[0]} of {counted[1]} ({counted[2]:,})",
        f"{100 * finest['volume_change']:.2g} %",
        number(finest["smallest_det"], 2),
        f"{record['seconds']:.0f}",
    ]
    return [row]


if __name__ == "__main__":
    sys.exit(main())
