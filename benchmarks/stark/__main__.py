"""pdvol beside STARK: both run the same scenes in turn on one machine, and their times are divided.

    ./run python -m benchmarks.stark --stark DIR [--scenes drop_500,balls | --all] [--repeats 3]

DIR is the folder that holds STARK's Python module `pystark`, built for the Python of `./run`. Each scene is run by
STARK and by pdvol alternately, each run in a process of its own with one thread. Both get the same mesh, stiffness,
time step, contact distance and stop criterion. Seconds are CPU seconds (user and system) of the steps, without
start-up, storage and the first step, so that other work on the machine hardly counts. They are divided by the tick,
the time of a fixed loop between the steps: a core of a shared host runs at its best or at half of that.

The table is written between the markers of docs/benchmarks.md; rows that are not run again stay. The exit code is 0
when every run came to its end, 1 otherwise, and 2 for a wrong command line.
"""

import argparse
import json
import os
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.common import commits, process, tables
from benchmarks.common.process import REPOSITORY
from benchmarks.stark import rows, shot
from benchmarks.stark.rows import ROWS
from pdvol.errors import PdvolError
from pdvol.measure.verify import signed_volumes
from pdvol.runs.scene_file import load_shot
from pdvol.store.reader import open_run

BEGIN, END = "<!-- benchmarks.stark: table -->", "<!-- benchmarks.stark: end -->"
LIMIT = 1800.0
"""CPU seconds after which a run stops between two steps."""
IMPORTING = 120.0
"""Seconds for an import of pystark."""


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    options = parsed(words)
    try:
        names = chosen(options.scenes, options.all)
        if options.repeats < 1 or (options.steps or 2) < 2:
            raise process.Mistake("--repeats needs a whole number from 1 on, --steps one from 2 on")
        if not (options.peers / "README.md").is_file():
            raise process.Mistake(f"--peers {options.peers} has no README.md; name the folder of the peers' meshes")
        tables.between(options.docs, BEGIN, END)
        options.out.mkdir(parents=True, exist_ok=True)
        check_module(options.stark)
        commit = commits.Repository(REPOSITORY).head()
    except (process.Mistake, commits.MissingObject, OSError) as error:
        print(f"benchmarks.stark: {error}", file=sys.stderr)
        return 2
    table = Table(options.out / "stark.json", options.docs)
    ended_well = True
    for name in names:
        records = in_turn(name, options, commit)
        ended_well &= not any(run["reason"] for system in rows.SYSTEMS for run in records[system])
        table.add(name, records)
        print(" | ".join(rows.cells(name, records)), file=sys.stderr, flush=True)
    print(table)
    return int(not ended_well)


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The options."""
    parser = process.parser("stark", __doc__)
    add, shared = parser.add_argument, REPOSITORY.parent / "shared" / "peers"
    add("--stark", type=Path, metavar="DIR", help="the folder that holds the built module pystark")
    add("--scenes", default="", metavar="NAME,...", help=f"rows: {', '.join(ROWS)} (default: the short ones)")
    add("--all", action="store_true", help="the rows of 20,000 vertices, too")
    add("--repeats", type=int, default=3, metavar="N", help="runs of each (default: 3)")
    add("--steps", type=int, help="so many steps at most, instead of each row's own")
    add("--peers", type=Path, default=shared, metavar="DIR", help="the peers' meshes")
    add("--out", type=Path, default=REPOSITORY / "runs" / "stark", metavar="DIR", help="for stark.json, the records")
    page = REPOSITORY / "docs" / "benchmarks.md"
    add("--docs", type=Path, default=page, metavar="FILE", help="where the table is kept")
    return parser.parse_args(words)


def chosen(text: str, everything: bool) -> list[str]:
    """Names of rows, in their order."""
    words = set(filter(None, text.split(",")))
    if words - ROWS.keys():
        raise process.Mistake(f"there is no scene {min(words - ROWS.keys())!r}; choose from {', '.join(ROWS)}")
    return [name for name, row in ROWS.items() if (name in words if words else everything or not row.long)]


def check_module(folder: Path | None) -> None:
    """Raises Mistake where `folder` has no module pystark that this Python can import."""
    mend = "name the folder that holds STARK's built module pystark"
    if folder is None:
        raise process.Mistake(f"--stark DIR is missing; {mend}")
    if not folder.is_dir():
        raise process.Mistake(f"--stark {folder}: there is no such folder; {mend}")
    if not (folder / "pystark" / "__init__.py").is_file():
        raise process.Mistake(f"--stark {folder} has no pystark/__init__.py; {mend}")
    with tempfile.TemporaryDirectory(prefix="pdvol-stark-") as aside:
        log = Path(aside) / "import.log"
        reason = process.child([*with_stark(folder), "-c", "import pystark"], IMPORTING, log)
    if reason:
        version = ".".join(map(str, sys.version_info[:2]))
        raise process.Mistake(f"--stark {folder}: import pystark fails: {reason}; build it for Python {version}")


def with_stark(folder: Path) -> list[str]:
    """The start of a command: this Python, which finds pystark and the benchmarks."""
    return ["env", f"PYTHONPATH={folder.resolve()}{os.pathsep}{REPOSITORY}", sys.executable]


# ---- runs


def in_turn(name: str, options: argparse.Namespace, commit: str) -> dict[str, list[dict]]:
    """The records of a row, by system; those of pdvol say how far its last positions are from STARK's."""
    row = ROWS[name]
    settings = row.settings | ({"peers": str(options.peers.resolve())} if row.file == rows.PEERS else {})
    steps = min(options.steps or row.steps, row.steps)
    records: dict[str, list[dict]] = {system: [] for system in rows.SYSTEMS}
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as aside:
        folder = Path(aside)
        shot.write(load_shot(REPOSITORY / row.file, settings, steps).scene, folder / "shot.npz")
        for _ in range(options.repeats):
            theirs, their_end = by_stark(options.stark, folder, options.out.resolve() / "cache", steps)
            ours, our_end = by_pdvol(REPOSITORY / row.file, settings, folder, steps)
            distance = 0.0 if their_end is None or our_end is None else np.linalg.norm(their_end - our_end, axis=1)
            ours |= {"apart": [float(np.median(distance)), float(np.max(distance))], "commit": commit}
            records["stark"].append(theirs)
            records["pdvol"].append(ours)
    return records


def by_stark(stark: Path, folder: Path, cache: Path, steps: int) -> tuple[dict, np.ndarray | None]:
    """The record of one run by STARK, and its last positions (n, 3) [m]."""
    out, load = folder / "stark.npz", os.getloadavg()[0]
    out.unlink(missing_ok=True)
    words = ["-m", "benchmarks.stark.run_one", folder / "shot.npz", out, cache, LIMIT]
    reason = process.child([*with_stark(stark), *map(str, words)], 4.0 * LIMIT, folder / "stark.log")
    if not out.is_file():
        return ended({}, steps, reason or "it left no result", load), None
    with np.load(out) as arrays:
        found, last = json.loads(str(arrays["record"])), arrays["last"]
    with np.load(folder / "shot.npz") as arrays:
        bodies = [name.partition("_")[2] for name in arrays if name.startswith("points_")]
        meshes = [(arrays[f"points_{k}"], arrays[f"cells_{k}"]) for k in bodies]
    offsets = np.cumsum([0, *(len(points) for points, _ in meshes)])
    rest = np.concatenate([points for points, _ in meshes])
    cells = np.concatenate([cells + offset for (_, cells), offset in zip(meshes, offsets, strict=False)])
    return ended(found | {"inverted": inverted(rest, last, cells), "vertices": len(rest)}, steps, reason, load), last


def by_pdvol(file: Path, settings: dict, folder: Path, steps: int) -> tuple[dict, np.ndarray | None]:
    """The record of one run by pdvol, and its last positions (n, 3) [m]."""
    load = os.getloadavg()[0]
    with tempfile.TemporaryDirectory(dir=folder) as aside:
        path = Path(aside) / "run"
        script = REPOSITORY / "benchmarks" / "dense" / "run_one.py"
        words = [script, REPOSITORY, "cpu", LIMIT, file, path, steps, json.dumps(settings), 0]
        command = ["env", f"PYTHONPATH={REPOSITORY}", sys.executable, *map(str, words)]
        reason = process.child(command, 4.0 * LIMIT, folder / "pdvol.log")
        try:
            level = open_run(path).levels[0]
        except PdvolError as error:
            return ended({}, steps, reason or str(error), load), None
        if level.steps < 2:
            return ended({}, steps, reason or "no step was done", load), None
        log, last = level.log[: level.steps - 1], level.positions(level.steps - 1)
        times = json.loads(path.with_suffix(".json").read_text())
        found = {
            "seconds": times["seconds"][: len(log)],
            "newton": [record["newton_iterations"] for record in log],
            "dt": [1.0] * len(log),
            "ticks": times["ticks"],
            "inverted": inverted(level.rest, last, level.cells),
            "vertices": len(level.rest),
        }
        return ended(found, steps, reason, load), last


def ended(found: dict, steps: int, reason: str, load: float) -> dict:
    """The record of a run, with what was wrong with it and the machine's load before it."""
    ticks, taken = found.pop("ticks", []), found.get("dt", [])
    done = sum(taken) / max(taken) if taken else 0.0
    if not reason and round(done) < steps:
        reason = f"stopped after {done:.0f} of {steps} steps and {sum(found.get('seconds', [])):.0f} s"
    return {**found, "tick": float(np.mean(ticks)) if ticks else 1.0, "reason": reason, "load": load}


def inverted(rest: np.ndarray, now: np.ndarray, cells: np.ndarray) -> int:
    """How many cells (m, 4) have turned inside out between positions (n, 3) [m]."""
    return int(np.count_nonzero(~(signed_volumes(now, cells) / signed_volumes(rest, cells) > 0)))


# ---- what is kept


class Table:
    """The records of all rows, kept in a file, and their table, kept between the markers of a page."""

    def __init__(self, path: Path, docs: Path):
        self._path, self._docs = path, docs
        self.rows = json.loads(path.read_text())["rows"] if path.is_file() else {}

    def add(self, name: str, records: dict[str, list[dict]]) -> None:
        """Adds a row, and writes the records and the page."""
        self.rows[name] = records
        self._path.write_text(json.dumps({"machine": process.machine(), "rows": self.rows}) + "\n")
        before, after = tables.between(self._docs, BEGIN, END)
        self._docs.write_text(f"{before}{BEGIN}\n{self}\n{END}{after}")

    def __str__(self) -> str:
        machine = process.machine()
        return f"{machine['processor']}, one of {machine['cores']} cores for each run.\n\n{rows.tabled(self.rows)}"


if __name__ == "__main__":
    sys.exit(main())
