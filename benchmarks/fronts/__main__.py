"""Speed against accuracy of eight scenes: runs `pdvol study` on each of them and writes their table and pictures.

    ./run python -m benchmarks.fronts [spike,drop,...] [--budget 4] [--out runs/fronts] [--write]
    ./run python -m benchmarks.fronts --random 10 [--first 0] [--budget 1]

Finished runs in `--out` are used again, so that a study that was stopped goes on. `--write` puts the table between the
marks of NOTES.md beside this file, and the fronts into docs/pictures. `--random` is what trials.py has.
"""

import json
import math
import sys
from pathlib import Path

from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import chosen
from benchmarks.common.study import command
from benchmarks.common.tables import Page, number, table
from benchmarks.fronts import trials
from pdvol.studio.study.conclusions import length, option_text
from pdvol.studio.study.front import cheapest_within, most_accurate_within
from pdvol.studio.study.page import front_figure

SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "spike": ("demos/ball_on_spike.py", ()),
    "drop": ("demos/drop.py", ()),
    "ape": ("demos/ape.py", ("--steps", "200")),
    "twist": ("demos/twist.py", ()),
    "heterogeneous": ("demos/heterogeneous.py", ("--set", "drop=0.4", "--steps", "120")),
    "rope": ("demos/rope_drop.py", ()),
    **{name: ("benchmarks/fronts/scenes.py", ("--set", f"name={name}")) for name in ("sliding_block", "tower")},
}
"""Scene files and their options. The ape swings for two of its eight seconds."""
VARIED = ("--vary", "dt,integrator,elements,tolerance,level")
HEAD = ["scene", "levels, vertices", "the scene's settings: CPU [s], error at the end, of the size"]
HEAD += ["the reference's own error", "differences of the start grow", "cheapest within 1 %", "cheapest within 3 %"]
HEAD += ["most accurate at half the time", "fitted orders"]


@command(
    "fronts",
    __doc__,
    {
        "scenes": {"nargs": "?", "default": "", "help": ", ".join(SCENES)},
        "--budget": {"default": "4", "help": "minutes a scene"},
        "--out": {"type": Path, "default": Path("runs/fronts")},
        "--write": {"action": "store_true", "help": "put the table and the fronts into their pages"},
        "--dry": {"action": "store_true", "help": "no studies: what is stored in --out"},
        "--random": {"type": int, "metavar": "N", "help": "so many random shots instead: whether predictions hold"},
        "--first": {"type": int, "default": 0, "help": "the number of the first random shot"},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    names = chosen(options.scenes, SCENES)
    if options.random:
        trials.compare(options)
        return
    for name in names if not options.dry else ():
        file, more = SCENES[name]
        words = ["study", str(REPOSITORY / file), "-o", str(options.out / name), *VARIED, "--budget", options.budget]
        trials.pdvol([*words, *more])
    stored = {name: options.out / name / "study.json" for name in SCENES}
    studies = {name: json.loads(file.read_text()) for name, file in stored.items() if file.is_file()}
    text = fronts_table(studies)
    print(text)
    if options.write:
        Page(Path(__file__).with_name("NOTES.md"), "fronts", "table").write(text)
        for name, study in studies.items():
            if study["points"]:
                front_figure(study).savefig(REPOSITORY / "docs" / "pictures" / f"front_{name}.png", dpi=110)


def fronts_table(studies: dict[str, dict]) -> str:
    """One row a scene, and the machine below."""
    rows = [_row(name, study) for name, study in studies.items() if "reference" in study]
    machines = {
        f"{s['machine']['processor']}, {s['machine']['cores']} cores, {s['jobs']} runs at a time"
        for s in studies.values()
        if "machine" in s
    }
    return f"{table(HEAD, rows)}\n\n{'; '.join(sorted(machines))}."


def _row(name: str, study: dict) -> list[str]:
    points, known, size = study["points"], study["reference"]["error"], study["size"]
    own = math.inf if known is None else known
    default, spread = study["default"], study["spread"] or {}
    same = [point for point in points if point["errors"]["outcome"]]
    best = most_accurate_within(same, 0.5 * default["cost"]["cpu"])
    orders = [f"{o['axis']} {o['order']:.2f}" for o in study["orders"] if o["order"] is not None]
    return [
        name,
        ", ".join(f"{level['vertices']:,}" for level in study["levels"]),
        f"{number(default['cost']['cpu'])}, {length(default['errors']['end'])}, {default['errors']['share']:.2%}"
        f"{'' if default['errors']['outcome'] else ', another outcome'}",
        "unknown" if known is None else length(known),
        f"{spread['growth']:.2g} times{', chaotic' if spread['chaotic'] else ''}" if spread else "-",
        *(_cell(cheapest_within(points, fraction * size, own), default) for fraction in (0.01, 0.03)),
        _cell(best, default),
        "; ".join(orders) or "-",
    ]


def _cell(point: dict | None, default: dict) -> str:
    if point is None:
        return "none found"
    fraction = point["cost"]["cpu"] / default["cost"]["cpu"]
    return f"{option_text(point)}: {length(point['errors']['end'])} in {fraction:.0%} of the time"


if __name__ == "__main__":
    sys.exit(main())
