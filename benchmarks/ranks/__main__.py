"""What MPI ranks gain: each row's scene on one and more ranks in turn, by the wall clock."""

import sys
import tempfile
from functools import partial
from pathlib import Path
from statistics import fmean

from benchmarks.common import commits, march
from benchmarks.common.process import REPOSITORY, Failure, machine
from benchmarks.common.rows import NAMES, ROWS, chosen
from benchmarks.common.study import command, each
from benchmarks.common.tables import table

CHOSEN = ("drop_500", "twistx_1k", "jelly_bowl", "drop_4k", "blocks", "balls", "twist_20k", "drop_20k", "twist_100k")
CHOSEN += ("twist_300k", "leaf_sheep", "jelly_bowl_1", "jelly_bowl_2", "noodles")
HEAD = ["scene", "vertices", "ranks", "time a step [ms]", "times as fast as the first"]
HEAD += ["CPU time a step, all ranks [ms]", "Newton", "conjugate gradients a step"]
HEAD += [*(f"{part} [ms]" for part in march.PARTS), "memory of rank 0 [MB]"]


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
    with tempfile.TemporaryDirectory() as folder:
        run = Path(folder) / "run"

        def measured(name: str) -> dict:
            row, steps = ROWS[name], ROWS[name].most(options.steps)
            sides = {str(ranks): partial(march.march, row, run, steps, ranks=ranks) for ranks in options.ranks}
            found = march.in_turn(sides, options.runs)
            for reason in (record["reason"] for some in found.values() for record in some if record["reason"]):
                raise Failure(f"{row.title}: {reason}")
            return found

        print(table(HEAD, each(names, measured, cells)))


def cells(name: str, runs: dict[str, list[dict]]) -> list[list[str]]:
    """A row for each number of ranks, by its fastest run."""
    best = {ranks: min(some, key=march.pace) for ranks, some in runs.items()}
    first = next(iter(best.values()))
    return [
        [
            ROWS[name].title,
            f"{run['vertices']:,}",
            ranks,
            f"{1e3 * march.pace(run):.1f}",
            f"{march.pace(first) / march.pace(run):.2f}",
            f"{1e3 * run['cpu']:.0f}",
            f"{fmean(run['newton']):.1f}",
            f"{fmean(run['linear']):.0f}",
            *(f"{1e3 * run['parts'][part]:.1f}" for part in march.PARTS),
            f"{run['memory']:.0f}",
        ]
        for ranks, run in best.items()
    ]


if __name__ == "__main__":
    sys.exit(main())
