"""The stability envelope: every scene of scenes.py under a limit of time, and one table of the outcomes.

    ./run python -m benchmarks.extremes [--rows young,dt_0.1] [--out runs/extremes] [--limit 900] [--starts 10]

Rows are named in full or by their first letters; rows already in the folder --out stay in the table. Each row runs in
a process of its own, and `pdvol verify` checks every state for intersections and inverted cells. With --starts each
row is repeated that often from starts moved by up to 1e-3 of the bodies' sizes. The exit code is 0 when every row came
to its end or ended with a named error and no state is wrong, 1 otherwise, and 2 for a wrong command line.
"""

import sys
from pathlib import Path

import numpy as np

from benchmarks.common import process, trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.tables import table

FILE = Path(__file__).with_name("scenes.py")
HEAD = [
    "row",
    "vertices",
    "steps",
    "outcome",
    "smallest gap [m]",
    "smallest det F",
    "energy change",
    "energy rise",
    "Newton mean (most)",
    "cuts",
    "time [s]",
]
STARTS = [
    "row",
    "starts",
    "done",
    "states wrong",
    "smallest gap [m]",
    "smallest det F",
    "Newton mean",
    "mean position at the end, spread [m]",
]


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("extremes", __doc__)
    parser.add_argument(
        "--rows", default="", metavar="NAME,...", help="rows by name or by how their names begin (default: all)"
    )
    parser.add_argument(
        "--out",
        type=Path,
        default=REPOSITORY / "runs" / "extremes",
        metavar="DIR",
        help="for extremes.json and extremes.md",
    )
    parser.add_argument(
        "--limit", type=float, default=900.0, metavar="SECONDS", help="a row is ended after so long (default: 900)"
    )
    parser.add_argument(
        "--starts", type=int, default=0, metavar="N", help="so many jittered starts of each row, instead of its own"
    )
    options = parser.parse_args(words)
    try:
        from benchmarks.extremes import figures, scenes

        names = trials.chosen(options.rows, scenes.SCENES)
        kept = trials.Trials(options.out, "extremes", scenes.SCENES, names, tabled)
    except (process.Mistake, OSError) as error:
        print(f"benchmarks.extremes: {error}", file=sys.stderr)
        return 2
    for name in names:
        for seed in range(1, options.starts + 1) if options.starts else (0,):
            own: list[str] = []
            keep = lambda path, name=name, own=own: own.append(figures.figure(name, path))
            record = trials.trial(FILE, name, float("inf"), options.limit, keep, seed)
            record["figure"] = "".join(own)
            kept.add(record, " | ".join(cells(record)))
    print(kept)
    return int(not all(trials.sound(record) for record in kept.records))


def tabled(records: list[dict]) -> str:
    """The table, and the lines of rows that have figures of their own; for jittered starts, one row per scene."""
    names = list(dict.fromkeys(record["name"] for record in records))
    if len(names) < len(records):
        return table(STARTS, [summary([record for record in records if record["name"] == name]) for name in names])
    lines = [f"- {record['name']}: {record['figure']}" for record in records if record.get("figure")]
    return "\n".join([table(HEAD, [cells(record) for record in records]), *([""] if lines else []), *lines])


def cells(record: dict) -> list[str]:
    """One row; for several levels, the extremes of all."""
    levels = [level for level in record["levels"] if level["newton"]["mean"] is not None]
    outcome = {"done": "done", "hang": "ended by the clock"}.get(record["outcome"], record["outcome"])
    if not levels:
        return [record["name"], "", "0", outcome, *[""] * 6, trials.number(record.get("wall_seconds"))]

    def every(key: str) -> list:
        return [level[key] for level in levels if level[key] is not None]

    vertices = ", ".join(str(level["vertices"]) for level in levels)
    steps = levels[-1]["steps"]
    wrong = f", {len(record['problems'])} states wrong" if record["problems"] else ""
    mean = sum(level["newton"]["mean"] * level["steps"] for level in levels) / max(
        sum(level["steps"] for level in levels), 1
    )
    return [
        record["name"],
        vertices,
        str(steps) if steps == record["steps"] else f"{steps} of {record['steps']}",
        outcome + wrong,
        trials.number(min(every("gap_min"), default=None)),
        trials.number(min(every("det_f_min"), default=None)),
        trials.number(max(every("energy_change"), key=abs, default=None)),
        trials.number(max(every("energy_rise"), default=None)),
        f"{mean:.1f} ({max(level['newton']['max'] for level in levels)})",
        str(sum(every("cuts"))),
        f"{sum(every('seconds')):.1f}",
    ]


def summary(records: list[dict]) -> list[str]:
    """One row for all starts of a scene: how many came to their end, extremes, and the mean distance of the bodies'
    vertices between starts at the end.
    """
    last = [record["levels"][-1] for record in records if record["levels"]]
    ends = np.array([level["end"] for level in last if level["end"] is not None])
    spread = np.linalg.norm(ends - ends.mean(axis=0), axis=1).max() if len(ends) else None
    return [
        records[0]["name"],
        str(len(records)),
        str(sum(record["outcome"] == "done" for record in records)),
        str(sum(len(record["problems"]) for record in records)),
        trials.number(min((v["gap_min"] for v in last if v["gap_min"]), default=None)),
        trials.number(min((v["det_f_min"] for v in last if v["det_f_min"]), default=None)),
        f"{min(v['newton']['mean'] for v in last):.1f} to {max(v['newton']['mean'] for v in last):.1f}",
        trials.number(spread),
    ]


if __name__ == "__main__":
    sys.exit(main())
