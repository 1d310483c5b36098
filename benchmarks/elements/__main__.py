"""Smoothed elements beside linear ones: free vibrations of an ape and of a bar, and time of everyday steps in turn.

    ./run python -m benchmarks.elements [--rows drop_500,twistx_1k] [--steps 60] [--runs 3]

Frequencies are squared, over those of the best discretisation at hand: what a body is stiffer than it should be. Rows
are those of benchmarks.dense; figures of linear elements stand first. The tables are written between the markers of
NOTES.md beside this file.
"""

import sys
import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.common import march
from benchmarks.common.process import machine
from benchmarks.common.rows import NAMES, ROWS, chosen
from benchmarks.common.study import command, each
from benchmarks.common.tables import Page, table
from benchmarks.elements import frequencies

ELEMENTS = ("linear", "smoothed")
"""In the order of the tables' columns."""
EVERYDAY = ("drop_500", "twistx_1k", "drop_4k", "blocks", "stack", "plates", "balls")
THROUGH = (1, 2, 4)
"""Cells through the thickness of the bars."""
NONZEROS = "nonzeros, times those of linear ones"


@command(
    "elements",
    __doc__,
    {
        "--rows": {**NAMES, "help": f"rows (default: {', '.join(EVERYDAY)})"},
        "--steps": {"type": int, "default": 60, "help": "of a row at most (default: 60)"},
        "--runs": {"type": int, "default": 3, "help": "of each kind of elements (default: 3)"},
        "--docs": {"type": Path, "default": Path(__file__).with_name("NOTES.md"), "help": "where tables are kept"},
    },
)
def main(options) -> None:
    """Runs the command; returns its exit code."""
    names, page = chosen(options.rows, ROWS, EVERYDAY), Page(options.docs, "elements")

    def measured(name: str) -> dict:
        row, steps = ROWS[name], ROWS[name].most(options.steps)
        with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
            rows = {kind: replace(row, settings={**row.settings, "elements": kind}) for kind in ELEMENTS}
            sides = {kind: partial(march.march, own, Path(folder) / "run", steps) for kind, own in rows.items()}
            return march.in_turn(sides, options.runs)

    times = each(names, measured, lambda name, records: [march.versus(ROWS[name].title, records)])
    own = machine()
    tables = [*stiffness(), table(march.HEAD, times)]
    report = "\n\n".join([f"{own['processor']}, one of {own['cores']} cores.", *tables])
    print(report)
    page.write(report)


def stiffness() -> list[str]:
    """The tables of frequencies, of the ape and of the bar."""
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
    modes = [f"{what}, {kind}" for what in ("bending", "torsion") for kind in ELEMENTS]
    return [
        table(["ape: vertices", *ELEMENTS, NONZEROS], apes),
        table(["bar: cells through", "vertices", *modes, NONZEROS], bars),
    ]


if __name__ == "__main__":
    sys.exit(main())
