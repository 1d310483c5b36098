"""What MPI ranks gain: each row's scene on one and more ranks in turn, by `pdvol run`'s own log."""

import json
import os
import statistics
import sys
import tempfile
from pathlib import Path

from benchmarks.common import commits, process, tables
from benchmarks.ranks.one_rank import COLUMNS
from benchmarks.ranks.rows import ROWS, Row, words_of
from pdvol.compiled import build
from pdvol.runs.launcher import rank_command
from pdvol.store.reader import open_run

LIMIT = 1800.0  # seconds of wall-clock time that one run may take
PARTS = ("assembly", "contact", "ccd", "linear", "other")


def measured(row: Row, ranks: int, folder: Path) -> dict:
    """What one run gives, per step."""
    out = folder / "run"
    words = [*words_of(row, out), "--ranks", str(ranks)]
    reason = process.child([sys.executable, "-m", "pdvol", *words], LIMIT, folder / "run.log")
    if reason:
        raise process.Mistake(f"{row.title} on {ranks} ranks: {reason}")
    level = open_run(out).levels[row.level]
    log = level.log[1:]
    mean = lambda numbers: statistics.fmean(list(numbers))
    return {
        "vertices": len(level.rest),
        "wall": mean(record["seconds"]["total"] for record in log),
        "cpu": mean(record["seconds"]["cpu"] for record in log),
        "parts": {part: mean(record["seconds"][part] for record in log) for part in PARTS},
        "newton": mean(record["newton_iterations"] for record in log),
        "linear": mean(record["linear_iterations"] for record in log),
        "memory": log[-1]["peak_memory_mb"],
    }


def table(found: dict[str, dict[int, list[dict]]]) -> str:
    """The fastest run of each row and number of ranks."""
    head = ["scene", "vertices", "ranks", "time a step [ms]", "times as fast as one", "CPU time a step, all ranks [ms]"]
    head += ["Newton", "conjugate gradients a step", *(f"{part} [ms]" for part in PARTS), "most memory of a rank [MB]"]
    lines = []
    for name, by_ranks in found.items():
        best = {ranks: min(runs, key=lambda run: run["wall"]) for ranks, runs in by_ranks.items() if runs}
        one = best.get(1)
        for ranks, run in best.items():
            gain = f"{one['wall'] / run['wall']:.2f}" if one else ""
            cells = [ROWS[name].title, f"{run['vertices']:,}", str(ranks), f"{1e3 * run['wall']:.1f}", gain]
            cells += [f"{1e3 * run['cpu']:.0f}", f"{run['newton']:.1f}", f"{run['linear']:.0f}"]
            cells += [f"{1e3 * run['parts'][part]:.1f}" for part in PARTS] + [f"{run['memory']:.0f}"]
            lines.append(cells)
    return tables.table(head, lines)


def preloaded(folder: Path) -> Path:
    """`messages.c`, built and linked with the MPI library in use."""
    target, maps = folder / "messages.so", Path("/proc/self/maps").read_text().splitlines()
    library = next(line.split()[-1] for line in maps if "/libmpi.so" in line)
    build([Path(__file__).with_name("messages.c")], target, ["-Wl,--no-as-needed", library])
    return target


def shares(row: Row, ranks: int, library: Path, folder: Path) -> dict:
    """What each rank does in a step, waiting left out: means over steps, an entry a rank."""
    out = folder / "shares.json"
    words = [sys.executable, "-m", "benchmarks.ranks.one_rank", out, *words_of(row, folder / "run")]
    launch, environment = rank_command(ranks)
    os.environ.update(environment)
    reason = process.child([*launch, "env", f"LD_PRELOAD={library}", *map(str, words)], LIMIT, folder / "run.log")
    if reason:
        raise process.Mistake(f"{row.title} on {ranks} ranks: {reason}")
    last = json.loads(out.read_text())[1 - row.steps :]  # of the level that is timed, without its first step
    means = {
        column: [statistics.fmean(step[rank][k] for step in last) for rank in range(ranks)]
        for k, column in enumerate(COLUMNS)
    }
    return {**means, "memory": [row[COLUMNS.index("memory")] for row in last[-1]]}


def table_of_shares(found: dict[str, dict[int, dict]]) -> str:
    """What the busiest rank of each row and number of ranks does."""
    head = ["scene", "ranks", "CPU time a step of the busiest rank [ms]", "that over one rank's"]
    head += ["mean of the ranks [ms]", *(f"{part} [ms]" for part in PARTS), "conjugate gradients a step"]
    head += ["sent a step by a rank, at most [kB]", "calls of MPI a step", "least memory, most [MB]"]
    lines = []
    for name, by_ranks in found.items():
        for ranks, run in by_ranks.items():
            total = [sum(run[part][rank] for part in PARTS) for rank in range(ranks)]
            busiest = max(range(ranks), key=total.__getitem__)
            cells = [ROWS[name].title, str(ranks), f"{1e3 * total[busiest]:.1f}"]
            first = by_ranks.get(1)
            cells += [f"{total[busiest] / sum(first[part][0] for part in PARTS):.2f}" if first else ""]
            cells += [f"{1e3 * statistics.fmean(total):.1f}"]
            cells += [f"{1e3 * run[part][busiest]:.1f}" for part in PARTS]
            cells += [f"{run['gradients'][0]:.0f}", f"{max(run['bytes']) / 1e3:.0f}", f"{max(run['calls']):.0f}"]
            lines.append([*cells, f"{min(run['memory']):.0f}, {max(run['memory']):.0f}"])
    return tables.table(head, lines)


def main() -> None:
    """Runs the rows and prints the table."""
    parser = process.parser("ranks", __doc__)
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--ranks", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--runs", type=int, default=2, help="of each number of ranks, in turn (default: 2)")
    parser.add_argument("--shares", action="store_true", help="CPU time of the busiest rank without waiting, and bytes")
    options = parser.parse_args()
    machine, commit = process.machine(), commits.Repository(process.REPOSITORY).head()[:7]
    print(f"{machine['processor']}, {machine['cores']} cores, load {machine['load']:.1f}, {commit}\n")
    found: dict[str, dict[int, list[dict]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        if options.shares:
            library, done = preloaded(Path(folder)), {}
            for name in options.rows:
                done[name] = {ranks: shares(ROWS[name], ranks, library, Path(folder)) for ranks in options.ranks}
                print(table_of_shares({name: done[name]}), flush=True)
            print(table_of_shares(done))
            return
        for name in options.rows:
            found[name] = {ranks: [] for ranks in options.ranks}
            for _ in range(options.runs):
                for ranks in options.ranks:
                    found[name][ranks].append(measured(ROWS[name], ranks, Path(folder)))
            print(table({name: found[name]}), flush=True)
    print(table(found))


if __name__ == "__main__":
    main()
