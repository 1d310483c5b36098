"""Smoothed elements beside linear ones: free vibrations of an ape and of a bar, and time of everyday steps in turn.

    ./run python -m benchmarks.elements [--rows drop_500,twistx_1k] [--steps 60] [--runs 3]

Frequencies are squared, over those of the best discretisation at hand: what a body is stiffer than it should be. Rows
are those of benchmarks.dense, each run in a process of its own with one thread, linear and smoothed elements in turn;
the median of the runs counts. Seconds are CPU seconds of the steps themselves, without the first one. The tables are
written between the markers of NOTES.md beside this file. The exit code is 2 for a wrong command line.
"""

import argparse
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.common import process
from benchmarks.common.process import REPOSITORY, Mistake, machine
from benchmarks.common.tables import between, number, table
from benchmarks.dense import __main__ as dense
from benchmarks.dense import rows as dense_rows
from benchmarks.elements import frequencies

BEGIN, END = "<!-- benchmarks.elements: tables -->", "<!-- benchmarks.elements: end -->"
ELEMENTS = ("linear", "smoothed")
"""In the order of the tables' columns."""
EVERYDAY = "drop_500,twistx_1k,drop_4k,blocks,stack,plates,balls"
THROUGH = (1, 2, 4)
"""Cells through the thickness of the bars."""


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    options = parsed(words)
    try:
        names = dense.chosen(options.rows, False) if options.rows else []
        before, after = between(options.docs, BEGIN, END)
    except (Mistake, OSError) as error:
        print(f"benchmarks.elements: {error}", file=sys.stderr)
        return 2
    report = f"{machine()['processor']}, one of {machine()['cores']} cores.\n\n{stiffness()}"
    print(report)
    if names:
        times = table(TIME_HEAD, [in_turn(name, options.steps, options.runs) for name in names])
        print(times)
        report = f"{report}\n\n{times}"
    options.docs.write_text(f"{before}{BEGIN}\n{report}\n{END}{after}")
    return 0


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The options."""
    parser = process.parser("elements", __doc__)
    parser.add_argument("--rows", default=EVERYDAY, metavar="NAME,...", help=f"of benchmarks.dense ({EVERYDAY})")
    parser.add_argument("--steps", type=int, default=60, help="of a row at most (default: 60)")
    parser.add_argument("--runs", type=int, default=3, help="of each kind of elements (default: 3)")
    parser.add_argument("--docs", type=Path, default=Path(__file__).with_name("NOTES.md"), help="where tables are kept")
    return parser.parse_args(words)


def stiffness() -> str:
    """The tables of frequencies."""
    apes = [
        [
            f"{row['vertices']:,}",
            *(f"{np.mean(row[kind]):.2f} (largest {max(row[kind]):.2f})" for kind in ELEMENTS),
            f"{row['nonzeros']:.2f}",
        ]
        for row in frequencies.apes()
    ]
    bars = [
        [
            str(row["cells"]),
            f"{row['vertices']:,}",
            *(f"{row[kind][mode]:.2f}" for mode in range(2) for kind in ELEMENTS),
            f"{row['blocks smoothed'] / row['blocks linear']:.2f}",
        ]
        for row in frequencies.bars(THROUGH)
    ]
    kinds = list(ELEMENTS)
    return "\n\n".join(
        [
            table(["ape: vertices", *kinds, "nonzeros, times those of linear ones"], apes),
            table(
                [
                    "bar: cells through",
                    "vertices",
                    *(f"{what}, {kind}" for what in ("bending", "torsion") for kind in kinds),
                ]
                + ["nonzeros, times those of linear ones"],
                bars,
            ),
        ]
    )


TIME_HEAD = [
    "scene",
    "vertices",
    "steps",
    "linear [ms a step]",
    "smoothed [ms a step]",
    "ratio (run by run)",
    "Newton a step: linear, smoothed",
    "ratio",
    "conjugate gradients a step: linear, smoothed",
]


def in_turn(name: str, steps: int, runs: int) -> list[str]:
    """The row of a scene: its elements in turn."""
    row = dense_rows.ROWS[name]
    steps = min(steps, row.steps)
    records: dict[str, list[dict]] = {kind: [] for kind in ELEMENTS}
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        for _ in range(runs):
            for kind, found in records.items():
                chosen = replace(row, settings={**row.settings, "elements": kind})
                found.append(dense.march(chosen, steps, REPOSITORY, "", Path(folder), Path(folder) / "end.npz"))
    failed = [record["reason"] for found in records.values() for record in found if record["reason"]]
    if failed:
        return [name, *["-"] * (len(TIME_HEAD) - 2), failed[0]]
    paces = {kind: [dense_rows.pace(record) for record in found] for kind, found in records.items()}
    mean = lambda what: [float(np.mean(records[kind][0][what])) for kind in ELEMENTS]
    newton, linear = mean("newton"), mean("linear")
    medians = [float(np.median(paces[kind])) for kind in ELEMENTS]
    ratios = [other / one for one, other in zip(*paces.values(), strict=True)]
    return [
        f"`{name}`",
        f"{records['linear'][0]['vertices']:,}",
        str(steps),
        *(number(1e3 * value) for value in medians),
        f"{medians[1] / medians[0]:.2f} ({', '.join(f'{ratio:.2f}' for ratio in ratios)})",
        pair(newton),
        f"{newton[1] / newton[0]:.2f}",
        pair(linear),
    ]


def pair(values: Sequence[float]) -> str:
    """Two figures."""
    return ", ".join(f"{value:.1f}" for value in values)


if __name__ == "__main__":
    sys.exit(main())
