"""The stability envelope: every scene of scenes.py under a limit of time, and one table of the outcomes.

    ./run python -m benchmarks.extremes [--rows young,dt_0.1] [--out runs/extremes] [--limit 900]

Rows are named in full or by their first letters; rows already in the folder --out stay in the table. Each row runs in
a process of its own, and `pdvol verify` checks every state for intersections and inverted cells. The exit code is 0
when every row came to its end or ended with a named error and no state is wrong, 1 otherwise, and 2 for a wrong command
line.
"""

import sys
from pathlib import Path

from benchmarks.common import process, trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import EXTREMES
from benchmarks.extremes import figures, scenes


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("extremes", __doc__)
    add = parser.add_argument
    add("--rows", dest="scenes", default="", metavar="NAME,...", help="by name or by its beginning (default: all)")
    add("--out", type=Path, default=REPOSITORY / "runs" / "extremes", metavar="DIR", help="for the table")
    add("--limit", type=float, default=900.0, metavar="SECONDS", help="of CPU time, for each row (default: 900)")
    options = parser.parse_args(words)
    return trials.run_all("extremes", EXTREMES, scenes.SCENES, options, options.limit, figures.figure)


if __name__ == "__main__":
    sys.exit(main())
