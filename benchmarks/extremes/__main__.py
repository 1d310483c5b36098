"""The stability envelope: every scene of scenes.py under a limit of time, and one table of the outcomes.

    ./run python -m benchmarks.extremes [--rows young,dt_0.1] [--out runs/extremes] [--limit 900]

Rows already in the folder --out stay in the table. Each runs in a process of its own, and `pdvol verify` checks every
state. The exit code is 0 when every row came to its end or to a named error and no state is wrong, 1 otherwise.
"""

import sys
from pathlib import Path

from benchmarks.common import trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import EXTREMES, NAMES
from benchmarks.common.study import command
from benchmarks.extremes import figures, scenes


@command(
    "extremes",
    __doc__,
    {
        "--rows": {**NAMES, "dest": "scenes", "help": "by name or by its beginning (default: all)"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "extremes", "help": "for the table"},
        "--limit": {"type": float, "default": 900.0, "help": "CPU seconds for each row (default: 900)"},
    },
)
def main(options) -> int:
    """Runs the command; returns its exit code."""
    return trials.run_all("extremes", EXTREMES, scenes.SCENES, options, options.limit, figures.figure)


if __name__ == "__main__":
    sys.exit(main())
