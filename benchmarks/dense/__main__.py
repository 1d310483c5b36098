"""Dense contact: the scenes of rows.py in turn with an earlier commit, on one machine, and their goals.

    ./run python -m benchmarks.dense [--scenes stack,balls | --long] [--against 97e899e] [--again]

Old and new code march the same scene file in turn, each run in a process of its own with one thread: up to three runs
of each, fewer once they have taken a minute together; the median counts. Seconds are CPU seconds (user and system) of
the steps themselves, without start-up, storage and the first step, so that other work on the machine does not count.
Beside them stands the tick, the time of a fixed loop between the steps: a core of a shared host runs at its best or at
half of that. Rows on two ranks are timed by the wall clock instead, and need a machine with nothing else to do.

The old commit's records are kept in the user's cache folder by commit and processor, and not measured again without
--again. It is needed after a change of a scene, and where the ticks of both differ by more than a tenth. The tables are
written between the markers of NOTES.md beside this file; rows that are not run again stay. The exit code is 0 when
every run of the new code came to its end or its time limit and `pdvol verify`'s check finds no wrong state, 1
otherwise, and 2 for a wrong command line.
"""

import argparse
import json
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.common import commits, process, tables
from benchmarks.common.process import REPOSITORY
from benchmarks.dense import rows
from benchmarks.dense.rows import ROWS, Row
from pdvol.errors import PdvolError
from pdvol.measure import verify
from pdvol.store.reader import open_run

BEGIN, END = "<!-- benchmarks.dense: tables -->", "<!-- benchmarks.dense: end -->"
RUNS, PATIENCE = 3, 60.0
"""Runs of a row with each code, and the seconds after which there are no more."""
CODE = ("pdvol", "forms", "meshes")
"""The folders of the package."""


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    options = parsed(words)
    try:
        names = chosen(options.scenes, options.long)
        tables.between(options.docs, BEGIN, END)
        repository = commits.Repository(REPOSITORY)
        against = repository.full(options.against)
        options.out.mkdir(parents=True, exist_ok=True)
        old = Baseline(cache(options.cache, against), repository, against)
    except (process.Mistake, commits.MissingObject, OSError) as error:
        print(f"benchmarks.dense: {error}", file=sys.stderr)
        return 2
    table = Table(options.out / "dense.json", options.docs)
    ended_well = True
    for name in names:
        steps = min(options.steps or ROWS[name].steps, ROWS[name].steps)
        records = in_turn(name, steps, old, repository.head(), options.again)
        ended_well &= not records[1]["reason"] and records[1]["states"] == "sound"
        table.add(name, *records)
        print(" | ".join(rows.row(name, *records)), file=sys.stderr, flush=True)
    print(table)
    return int(not ended_well)


def parsed(words: list[str] | None) -> argparse.Namespace:
    """The options."""
    parser = process.parser("dense", __doc__)
    parser.add_argument(
        "--scenes", default="", metavar="NAME,...", help=f"rows: {', '.join(ROWS)} (default: the everyday ones)"
    )
    parser.add_argument("--long", action="store_true", help="the rows that take long, too: hours")
    parser.add_argument("--against", default="97e899e", metavar="COMMIT", help="the old code (default: 97e899e)")
    parser.add_argument("--again", action="store_true", help="measure the old code again")
    parser.add_argument("--steps", type=int, help="so many steps at most, instead of each row's own")
    parser.add_argument(
        "--cache", type=Path, default=None, metavar="DIR", help="for the old code and its records (default: the user's)"
    )
    parser.add_argument(
        "--out", type=Path, default=REPOSITORY / "runs" / "dense", metavar="DIR", help="for dense.json, the records"
    )
    parser.add_argument(
        "--docs",
        type=Path,
        default=REPOSITORY / "benchmarks" / "dense" / "NOTES.md",
        metavar="FILE",
        help="where the tables are kept",
    )
    return parser.parse_args(words)


def chosen(text: str, long: bool) -> list[str]:
    """Names of rows, in their order."""
    words = set(filter(None, text.split(",")))
    if words - ROWS.keys():
        raise process.Mistake(f"there is no {min(words - ROWS.keys())!r}; choose from {', '.join(ROWS)}")
    return [name for name, row in ROWS.items() if (name in words if words else long or not row.long)]


def cache(folder: Path | None, commit: str) -> Path:
    """The folder of a commit's records on this machine's processor, made where it is missing."""
    if folder is None:
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(os.environ.get("PDVOL_CACHE") or Path(home) / "pdvol") / "dense_steps"
    processor = re.sub(r"\W+", "-", process.machine()["processor"]).strip("-")
    found = folder / f"{commit[:12]}-{processor}"
    found.mkdir(parents=True, exist_ok=True)
    return found


# ---- runs


class Baseline:
    """The old code and its records.

    Parameters
    ----------
    folder : of the records, kept
    repository : that has the code
    commit : in full
    """

    def __init__(self, folder: Path, repository: commits.Repository, commit: str):
        self.folder, self.commit, self._repository = folder, commit, repository

    def code(self) -> Path:
        """The folder of its package, written on first use."""
        path = self.folder / "code"
        if not path.is_dir():
            aside = Path(tempfile.mkdtemp(dir=self.folder))
            self._repository.write(self.commit, CODE, aside)
            for name in CODE[1:]:  # an editable install would find this repository's own
                if (aside / name).is_dir():
                    (aside / "pdvol" / name).symlink_to(Path("..") / name)
            aside.rename(path)
        return path

    def kept(self, name: str, steps: int) -> list[dict]:
        """The records of a row."""
        path = self.folder / f"{name}-{steps}.json"
        return json.loads(path.read_text()) if path.is_file() and self.end(name, steps).is_file() else []

    def keep(self, name: str, steps: int, records: list[dict]) -> None:
        """Keeps the records of a row."""
        (self.folder / f"{name}-{steps}.json").write_text(json.dumps(records) + "\n")

    def end(self, name: str, steps: int) -> Path:
        """The file of a row's last positions."""
        return self.folder / f"{name}-{steps}.npz"


def in_turn(name: str, steps: int, old: Baseline, head: str, again: bool) -> tuple[dict, dict]:
    """The median records of a row with the old and the new code."""
    kept = [] if again else old.kept(name, steps)
    records: tuple[list[dict], list[dict]] = (list(kept), [])
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        new_end = Path(folder) / "end.npz"
        for _ in range(RUNS):
            if not kept and wanted(records[0]):
                records[0].append(march(ROWS[name], steps, old.code(), old.commit, Path(folder), old.end(name, steps)))
            if wanted(records[1]):
                records[1].append(
                    march(ROWS[name], steps, REPOSITORY, head, Path(folder), new_end, check=not records[1])
                )
        if not kept:
            old.keep(name, steps, records[0])
        before, now = (median(some) for some in records)
        now["states"] = records[1][0]["states"]
        now["apart"] = apart(old.end(name, steps), new_end)
    return before, now


def wanted(records: list[dict]) -> bool:
    """Whether another run is worth its time."""
    spent = sum(sum(record["seconds"]) for record in records)
    return len(records) < RUNS and spent < PATIENCE and not any(record["reason"] for record in records)


def median(records: list[dict]) -> dict:
    """The record with the median time (of two the faster), or one that failed.

    `paces` are the seconds a step of all that did not.
    """
    failed = [record for record in records if record["reason"]]
    ordered = failed or sorted(records, key=rows.pace)
    paces = [rows.pace(record) for record in records if not record["reason"]]
    return {**ordered[(len(ordered) - 1) // 2], "runs": len(records), "paces": paces}


def march(row: Row, steps: int, code: Path, commit: str, folder: Path, end: Path, check: bool = False) -> dict:
    """The record of one run with the package in `code`; its last positions go into the file `end`."""
    path = folder / "run"
    clock = "cpu" if row.ranks == 1 else "wall"
    walls = []
    for ranks in range(1, row.ranks + 1):
        shutil.rmtree(path, ignore_errors=True)
        start = [sys.executable]
        if ranks > 1:  # mpi4py's own runner ends all ranks when one of them fails alone
            start = [shutil.which("mpirun") or "mpirun", "-n", str(ranks), sys.executable, "-m", "mpi4py"]
        words = [code, clock, row.limit, REPOSITORY / row.file, path, steps, json.dumps(row.settings), 0]
        command = ["env", f"PYTHONPATH={code}", *start, str(Path(__file__).with_name("run_one.py")), *map(str, words)]
        reason = process.child(command, 3.0 * row.limit + 600.0, folder / "run.log")
        times = json.loads(path.with_suffix(".json").read_text()) if path.with_suffix(".json").is_file() else {}
        ticks = times.get("ticks")
        found = measured(path, end, check, times.get("seconds", []))
        reason = reason or ("" if found["seconds"] else "no step was done")
        found |= {"reason": reason, "tick": sum(ticks) / len(ticks) if ticks else 1.0}
        walls.append(rows.pace(found) if found["seconds"] else 0.0)
    gain = {"gain": walls[0] / walls[1]} if row.ranks > 1 and walls[-1] else {}
    return {**found, **gain, "commit": commit}


def measured(path: Path, end: Path, check: bool, seconds: list[float]) -> dict:
    """What a run folder holds; with `check`, also whether its states (a hundred at most) are sound.

    `seconds` are those of the steps. The log has wall-clock seconds of their parts, which are scaled to them.
    """
    empty = {"seconds": [], "states": "none"}
    try:
        run = open_run(path)
        level = next((level for level in run.levels if level.steps > 1), None)
        if level is None:
            return empty
        last = level.steps - 1
        log = [record for record in level.log if record["step"] <= last]
        np.savez(end, rest=level.rest, last=level.positions(last), step=last, diagonal=run.info["diagonal"])
        first = np.unique(level.cells[level.bodies == 0])
        scale = sum(seconds[: len(log)]) / sum(record["seconds"]["total"] for record in log)
        return {
            "vertices": len(level.rest),
            "seconds": seconds[: len(log)],
            "parts": {part: scale * sum(record["seconds"].get(part, 0.0) for record in log) for part in rows.PARTS},
            "newton": [record["newton_iterations"] for record in log],
            "linear": [record["linear_iterations"] for record in log],
            "contacts": [record["contacts"] for record in log],
            "reached": [record["reached"] for record in log],
            "speed": float(np.linalg.norm(level.velocities(last)[first].mean(axis=0))),
            "states": soundness(path, last) if check else "",
        }
    except PdvolError as error:
        return {**empty, "states": str(error)}


def soundness(path: Path, steps: int) -> str:
    """`sound`, or the first things wrong with the states."""
    problems = [text for found in verify.check_levels(path, max(1, steps // 100)) for text in found.problems]
    return "; ".join(problems[:2]) or "sound"


def apart(old: Path, new: Path) -> float | None:
    """Largest distance of the last positions over the diagonal; None where they are not of one mesh and step."""
    if not (old.is_file() and new.is_file()):
        return None
    with np.load(old) as a, np.load(new) as b:
        same = a["step"] == b["step"] and a["rest"].shape == b["rest"].shape and np.allclose(a["rest"], b["rest"])
        return float(np.linalg.norm(a["last"] - b["last"], axis=1).max() / b["diagonal"]) if same else None


# ---- what is kept


class Table:
    """The records of all rows, kept in a file, and their tables, kept between the markers of a page."""

    def __init__(self, path: Path, docs: Path):
        self._path, self._docs = path, docs
        self.rows = json.loads(path.read_text())["rows"] if path.is_file() else {}

    def add(self, name: str, old: dict, new: dict) -> None:
        """Adds a row, and writes the record and the page."""
        self.rows[name] = [old, new]
        self._path.write_text(json.dumps({"machine": process.machine(), "rows": self.rows}) + "\n")
        before, after = tables.between(self._docs, BEGIN, END)
        self._docs.write_text(f"{before}{BEGIN}\n{self}\n{END}{after}")

    def __str__(self) -> str:
        pairs = {name: self.rows[name] for name in ROWS if name in self.rows}
        old = ", ".join(sorted({pair[0]["commit"][:7] for pair in pairs.values()}))
        machine = process.machine()
        return (
            f"{machine['processor']}, one of {machine['cores']} cores. Where two figures stand together, the first is"
            f" that of {old}. What is missed is in bold.\n\n"
            f"{rows.tables(pairs)}"
        )


if __name__ == "__main__":
    sys.exit(main())
