"""Smoothed elements beside linear ones: free vibrations of an ape and of a bar, and time of everyday steps in turn.

    ./run python -m benchmarks.elements [--rows drop_500,twistx_1k] [--steps 60] [--runs 3]

Frequencies are squared, over those of the best discretisation at hand: what a body is stiffer than it should be. Rows
are those of benchmarks.dense, each run in a process of its own with one thread, linear and smoothed elements in turn;
figures of linear elements stand first. The tables are written between the markers of NOTES.md beside this file. The
exit code is 2 for a wrong command line.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.common import march, process
from benchmarks.common.process import Mistake, machine
from benchmarks.common.rows import ROWS, chosen
from benchmarks.common.tables import Page, table
from benchmarks.elements import frequencies

ELEMENTS = ("linear", "smoothed")
"""In the order of the tables' columns."""
EVERYDAY = ("drop_500", "twistx_1k", "drop_4k", "blocks", "stack", "plates", "balls")
THROUGH = (1, 2, 4)
"""Cells through the thickness of the bars."""


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("elements", __doc__)
    parser.add_argument("--rows", default="", metavar="NAME,...", help=f"rows (default: {', '.join(EVERYDAY)})")
    parser.add_argument("--steps", type=int, default=60, help="of a row at most (default: 60)")
    parser.add_argument("--runs", type=int, default=3, help="of each kind of elements (default: 3)")
    parser.add_argument("--docs", type=Path, default=Path(__file__).with_name("NOTES.md"), help="where tables are kept")
    options = parser.parse_args(words)
    try:
        names, page = chosen(options.rows, ROWS, EVERYDAY), Page(options.docs, "elements")
    except (Mistake, OSError) as error:
        print(f"benchmarks.elements: {error}", file=sys.stderr)
        return 2
    times = table(march.HEAD, [in_turn(name, options.steps, options.runs) for name in names])
    report = f"{machine()['processor']}, one of {machine()['cores']} cores.\n\n{stiffness()}\n\n{times}"
    print(report)
    page.write(report)
    return 0


def in_turn(name: str, steps: int, runs: int) -> list[str]:
    """The row of a scene: its elements in turn."""
    row = ROWS[name]
    rows = {kind: replace(row, settings={**row.settings, "elements": kind}) for kind in ELEMENTS}
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        sides = {
            kind: lambda own=own: march.march(own, Path(folder) / "run", min(steps, own.steps or steps))
            for kind, own in rows.items()
        }
        return march.versus(row.title, march.in_turn(sides, runs))


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


if __name__ == "__main__":
    sys.exit(main())
