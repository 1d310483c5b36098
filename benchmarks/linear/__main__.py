"""pdvol's linear solver beside PETSc's preconditioners: the same systems of Newton's method, solved by each of them to
the same residual, on one and more ranks.
"""

import json
import os
import statistics
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from benchmarks.common import commits, process, tables
from benchmarks.linear.one_rank import METHODS
from benchmarks.ranks.rows import ROWS, words_of
from pdvol.runs.launcher import rank_command

LIMIT = 1200.0  # seconds of wall-clock time that one run may take
CHOSEN = ("twist_20k", "drop_20k", "jelly_bowl_2", "noodles")
"""Rows of `benchmarks.ranks` that are measured unless others are named."""


def measured(name: str, ranks: int, folder: Path, steps: int | None = None) -> list[dict]:
    """The rows of `one_rank.py` on the level that is timed, in at most so many `steps`."""
    row, out = ROWS[name], folder / "systems.json"
    row = replace(row, steps=min(row.steps, steps or row.steps))
    words = [sys.executable, "-m", "benchmarks.linear.one_rank", out, *words_of(row, folder / "run")]
    launch, environment = rank_command(ranks)
    os.environ.update(environment)
    reason = process.child([*launch, *map(str, words)], LIMIT, folder / "run.log")
    if reason:
        raise process.Mistake(f"{row.title} on {ranks} ranks: {reason}")
    rows = json.loads(out.read_text())
    finest = max(row["vertices"] for row in rows)
    return [row for row in rows if row["vertices"] == finest]


def table(found: dict[str, dict[int, list[dict]]]) -> str:
    """Means over the systems of each row and number of ranks."""
    head = ["scene", "ranks", "systems", "preconditioner", "iterations", "preparation [ms]", "solve [ms]"]
    head += ["together, over pdvol's", "systems not solved"]
    lines = []
    for name, by_ranks in found.items():
        for ranks, rows in by_ranks.items():
            own = sum(row["pdvol"][0] + row["pdvol"][1] for row in rows)
            for method in ("pdvol", *METHODS):
                prepared, solved, iterations, reached = zip(*(row[method] for row in rows), strict=True)
                cells = [ROWS[name].title, str(ranks), str(len(rows)), method, f"{statistics.fmean(iterations):.1f}"]
                cells += [f"{1e3 * statistics.fmean(numbers):.1f}" for numbers in (prepared, solved)]
                cells += [f"{(sum(prepared) + sum(solved)) / own:.2f}", str(len(rows) - sum(reached))]
                lines.append(cells)
    return tables.table(head, lines)


def main() -> None:
    """Runs the rows and prints the table."""
    parser = process.parser("linear", __doc__)
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(CHOSEN))
    parser.add_argument("--ranks", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--steps", type=int, help="so many steps at most, instead of each row's own")
    options = parser.parse_args()
    machine, commit = process.machine(), commits.Repository(process.REPOSITORY).head()[:7]
    print(f"{machine['processor']}, {machine['cores']} cores, load {machine['load']:.1f}, {commit}\n")
    found: dict[str, dict[int, list[dict]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in options.rows:
            found[name] = {ranks: measured(name, ranks, Path(folder), options.steps) for ranks in options.ranks}
            print(table({name: found[name]}), flush=True)
    print(table(found))


if __name__ == "__main__":
    main()
