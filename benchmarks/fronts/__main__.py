"""Speed against accuracy of eight scenes: runs `pdvol study` on each of them and writes their table and pictures.

    ./run python -m benchmarks.fronts [spike,drop,...] [--budget 4] [--out runs/fronts] [--write]

Finished runs in `--out` are used again, so that a study that was stopped goes on. `--write` puts the table between the
marks of NOTES.md beside this file, and the fronts into docs/pictures.
"""

import json
import math
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.common import process
from benchmarks.common.process import REPOSITORY
from benchmarks.common.tables import Page, number, table
from pdvol.studio.study.conclusions import length, option_text
from pdvol.studio.study.front import cheapest_within
from pdvol.studio.study.page import front_image

SCENES: dict[str, tuple[str, tuple[str, ...]]] = {
    "spike": ("demos/ball_on_spike.py", ()),
    "drop": ("demos/drop.py", ()),
    "ape": ("demos/ape.py", ("--steps", "200")),
    "twist": ("demos/twist.py", ()),
    "heterogeneous": ("demos/heterogeneous.py", ()),
    "rope": ("demos/rope_drop.py", ()),
    "sliding_block": ("benchmarks/fronts/sliding_block.py", ()),
    "tower": ("benchmarks/fronts/tower.py", ()),
}
"""Scene files and their options. The ape swings for two of its eight seconds."""
VARIED = ("--vary", "dt,integrator,elements,tolerance,level")
HEAD = [
    "scene",
    "levels, vertices",
    "the scene's settings: CPU [s], error at the end, of the size",
    "the reference's own error",
    "differences of the start grow",
    "cheapest within 1 %",
    "cheapest within 3 %",
    "most accurate at half the time",
    "fitted orders",
]


def main(words: Sequence[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("fronts", __doc__)
    parser.add_argument("scenes", nargs="?", default="", help=", ".join(SCENES))
    parser.add_argument("--budget", default="4", help="minutes a scene")
    parser.add_argument("--jobs", default="", help="runs at a time")
    parser.add_argument("--out", type=Path, default=Path("runs/fronts"))
    parser.add_argument("--write", action="store_true", help="put the table and the fronts into their pages")
    parser.add_argument("--dry", action="store_true", help="no runs: what is stored in --out")
    options = parser.parse_args(words)
    names = options.scenes.split(",") if options.scenes else list(SCENES)
    unknown = [name for name in names if name not in SCENES]
    if unknown:
        print(f"benchmarks.fronts: unknown scenes {unknown}; there are {', '.join(SCENES)}", file=sys.stderr)
        return 2
    for name in names if not options.dry else ():
        file, more = SCENES[name]
        command = [sys.executable, "-m", "pdvol", "study", str(REPOSITORY / file), "-o", str(options.out / name)]
        jobs = ["--jobs", options.jobs] if options.jobs else []
        subprocess.run([*command, *VARIED, "--budget", options.budget, *jobs, *more], check=False)
    stored = {name: options.out / name / "study.json" for name in SCENES}
    studies = {name: json.loads(file.read_text()) for name, file in stored.items() if file.is_file()}
    text = fronts_table(studies)
    print(text)
    if options.write:
        Page(Path(__file__).with_name("NOTES.md"), "fronts", "table").write(text)
        for name, study in studies.items():
            if study["points"]:
                front_image(REPOSITORY / "docs" / "pictures" / f"front_{name}.png", study)
    return 0


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
    half = [p for p in points if p["cost"]["cpu"] <= 0.5 * default["cost"]["cpu"] and p["errors"]["story"]]
    best = min(half, key=lambda p: p["errors"]["end"], default=None)
    orders = [f"{o['axis']} {o['order']:.2f}" for o in study["orders"] if o["order"] is not None]
    return [
        name,
        ", ".join(f"{level['vertices']:,}" for level in study["levels"]),
        f"{number(default['cost']['cpu'])}, {length(default['errors']['end'])}, {default['errors']['share']:.2%}"
        f"{'' if default['errors']['story'] else ', another story'}",
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
