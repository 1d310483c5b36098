"""What MPI ranks gain: each row's scene on one and more ranks in turn, by the wall clock."""

import sys
import tempfile
from pathlib import Path
from statistics import fmean

from benchmarks.common import commits, march, process
from benchmarks.common.rows import ROWS, chosen
from benchmarks.common.tables import table

CHOSEN = ("drop_500", "twistx_1k", "jelly_bowl", "drop_4k", "blocks", "balls", "twist_20k", "drop_20k", "twist_100k")
CHOSEN += ("twist_300k", "leaf_sheep", "jelly_bowl_1", "jelly_bowl_2", "noodles")
MOST = 60
"""Steps of a row at most."""
HEAD = [
    "scene",
    "vertices",
    "ranks",
    "time a step [ms]",
    "times as fast as the first",
    "CPU time a step, all ranks [ms]",
]
HEAD += ["Newton", "conjugate gradients a step", *(f"{part} [ms]" for part in march.PARTS), "memory of rank 0 [MB]"]


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


def main(words: list[str] | None = None) -> int:
    """Runs the rows and prints the table; returns the exit code."""
    parser = process.parser("ranks", __doc__)
    parser.add_argument("--rows", default="", metavar="NAME,...", help=", ".join(ROWS))
    parser.add_argument("--ranks", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--runs", type=int, default=2, help="of each number of ranks, in turn (default: 2)")
    parser.add_argument("--steps", type=int, default=MOST, help=f"of a row at most (default: {MOST})")
    options = parser.parse_args(words)
    try:
        names = chosen(options.rows, ROWS, CHOSEN)
        commit = commits.Repository(process.REPOSITORY).head()[:7]
    except (process.Mistake, commits.MissingObject) as error:
        print(f"benchmarks.ranks: {error}", file=sys.stderr)
        return 2
    machine, lines = process.machine(), []
    print(f"{machine['processor']}, {machine['cores']} cores, load {machine['load']:.1f}, {commit}\n")
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            steps = min(ROWS[name].steps or options.steps, options.steps)
            run = lambda ranks, name=name, steps=steps: march.march(
                ROWS[name], Path(folder) / "run", steps, ranks=ranks
            )
            sides = {str(ranks): lambda ranks=ranks, run=run: run(ranks) for ranks in options.ranks}
            found = march.in_turn(sides, options.runs)
            failed = [record["reason"] for some in found.values() for record in some if record["reason"]]
            if failed:
                print(f"benchmarks.ranks: {ROWS[name].title}: {failed[0]}", file=sys.stderr)
                return 1
            lines += cells(name, found)
            print(*(" | ".join(line) for line in lines[-len(found) :]), sep="\n", file=sys.stderr, flush=True)
    print(table(HEAD, lines))
    return 0


if __name__ == "__main__":
    sys.exit(main())
