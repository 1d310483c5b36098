"""What MPI ranks gain: each row's scene on one and more ranks in turn, by the wall clock.

    ./run python -m benchmarks.ranks [--rows drop_4k,balls] [--ranks 1 2 4] [--runs 2] [--steps 60]

Figures of the first number of ranks stand first, and the times of both are divided.
"""

import sys
import tempfile
from functools import partial
from pathlib import Path

from benchmarks.common import commits, march
from benchmarks.common.process import REPOSITORY, Failure, machine
from benchmarks.common.rows import NAMES, ROWS, chosen
from benchmarks.common.study import command
from benchmarks.common.tables import table

CHOSEN = ("drop_500", "twistx_1k", "jelly_bowl", "drop_4k", "blocks", "balls", "twist_20k", "drop_20k", "twist_100k")
CHOSEN += ("twist_300k", "leaf_sheep", "jelly_bowl_1", "jelly_bowl_2", "noodles")


@command(
    "ranks",
    __doc__,
    {
        "--rows": {**NAMES, "help": ", ".join(ROWS)},
        "--ranks": {"nargs": "+", "type": int, "default": [1, 2]},
        "--runs": {"type": int, "default": 2, "help": "of each number of ranks, in turn (default: 2)"},
        "--steps": {"type": int, "default": 60, "help": "of a row at most (default: 60)"},
    },
)
def main(options) -> None:
    """Runs the rows and prints the table; returns the exit code."""
    names, own = chosen(options.rows, ROWS, CHOSEN), machine()
    commit = commits.Repository(REPOSITORY).head()[:7]
    print(f"{own['processor']}, {own['cores']} cores, load {own['load']:.1f}, {commit}\n")
    first, *others = options.ranks
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for row in (ROWS[name] for name in names):
            one = partial(march.march, row, Path(folder) / "run", row.most(options.steps))
            runs = march.in_turn({str(ranks): partial(one, ranks=ranks) for ranks in options.ranks}, options.runs)
            for reason in (record["reason"] for some in runs.values() for record in some if record["reason"]):
                raise Failure(f"{row.title}: {reason}")
            for ranks in map(str, others):
                title = f"{row.title}, {first} and {ranks} ranks"
                found[title] = {"first": runs[str(first)], ranks: runs[ranks]}
                print(" | ".join(march.versus(title, found[title])), file=sys.stderr, flush=True)
    print(table(march.HEAD, [march.versus(*one) for one in found.items()]), march.by_part(found), sep="\n\n")


if __name__ == "__main__":
    sys.exit(main())
