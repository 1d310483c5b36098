"""Dense contact and everyday scenes: rows in turn with an earlier commit, on one machine.

    ./run python -m benchmarks.dense [--scenes stack,balls | --long] [--against 97e899e] [--again]

Old and new code march the same scene file in turn, each run in a process of its own with one thread: up to three runs
of each, fewer once they have taken a minute together; the median counts. Seconds are CPU seconds (user and system) of
the steps themselves, without start-up, storage and the first step, so that other work on the machine does not count.
Times are divided by the tick, the time of a fixed loop between the steps: a core of a shared host runs at its best or
at half of that.

The old commit's records are kept in the user's cache folder by commit and processor, and not measured again without
--again. It is needed after a change of a scene. The tables are written between the markers of NOTES.md beside this
file; rows that are not run again stay. The exit code is 0 when every run of the new code came to its end or its time
limit and `pdvol verify`'s check finds no wrong state, 1 otherwise, and 2 for a wrong command line.
"""

import json
import os
import re
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.common import commits, march, process
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import EVERYDAY, ROWS, Row, chosen
from benchmarks.common.tables import Kept, Page, number, table
from pdvol.errors import PdvolError
from pdvol.measure import verify

LONG = (*EVERYDAY, "impact", "struck", "pin", "gears", "piston", "ring", "belts", "capstan", "twist_20k", "drop_20k")
LONG += ("twist_100k", "twist_20_turns", "rods_twist", "mat_twist", "trash_compactor")
CODE = ("pdvol", "forms", "meshes")
"""The folders of the package."""
HEAD = [*march.HEAD, "contacts at the end", "farthest apart / diagonal", "states", "measured at"]


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("dense", __doc__)
    add = parser.add_argument
    add("--scenes", default="", metavar="NAME,...", help=f"rows: {', '.join(ROWS)} (default: the everyday ones)")
    add("--long", action="store_true", help="the rows that take long, too: hours")
    add("--against", default="97e899e", metavar="COMMIT", help="the old code (default: 97e899e)")
    add("--again", action="store_true", help="measure the old code again")
    add("--steps", type=int, help="so many steps at most, instead of each row's own")
    add("--cache", type=Path, metavar="DIR", help="for the old code and its records (default: the user's)")
    add("--out", type=Path, default=REPOSITORY / "runs" / "dense", metavar="DIR", help="for dense.json, the records")
    page = Path(__file__).with_name("NOTES.md")
    add("--docs", type=Path, default=page, metavar="FILE", help="where the tables are kept")
    options = parser.parse_args(words)
    try:
        names = chosen(options.scenes or (",".join(LONG) if options.long else ""), ROWS, EVERYDAY)
        repository = commits.Repository(REPOSITORY)
        against = repository.full(options.against)
        kept = Kept(options.out / "dense.json", ROWS, tabled, Page(options.docs, "dense"))
        old = Baseline(cache(options.cache, against), repository, against)
    except (process.Mistake, commits.MissingObject, OSError) as error:
        print(f"benchmarks.dense: {error}", file=sys.stderr)
        return 2
    ended_well = True
    for name in names:
        steps = min(options.steps or ROWS[name].steps, ROWS[name].steps)
        records = in_turn(name, steps, old, options.again) | {"commits": [against[:7], repository.head()[:7]]}
        ended_well &= not any(run["reason"] for run in records["new"]) and records["states"] == "sound"
        kept.add(name, records)
        print(" | ".join(cells(name, records)), file=sys.stderr, flush=True)
    print(kept)
    return int(not ended_well)


def cache(folder: Path | None, commit: str) -> Path:
    """The folder of a commit's records on this machine's processor, made where it is missing."""
    if folder is None:
        home = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(os.environ.get("PDVOL_CACHE") or Path(home) / "pdvol") / "dense_steps"
    processor = re.sub(r"\W+", "-", process.machine()["processor"]).strip("-")
    found = folder / f"{commit[:12]}-{processor}"
    found.mkdir(parents=True, exist_ok=True)
    return found


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
        """The records of a row, if its last state is kept, too."""
        path = self.folder / f"{name}-{steps}.json"
        return json.loads(path.read_text()) if path.is_file() and path.with_suffix(".npz").is_file() else []

    def keep(self, name: str, steps: int, records: list[dict], end: dict) -> None:
        """Keeps the records of a row and its last state."""
        path = self.folder / f"{name}-{steps}.json"
        path.write_text(json.dumps(records) + "\n")
        np.savez(path.with_suffix(".npz"), **end)

    def end(self, name: str, steps: int) -> dict:
        """The last state of a row."""
        with np.load(self.folder / f"{name}-{steps}.npz") as arrays:
            return dict(arrays)


def in_turn(name: str, steps: int, old: Baseline, again: bool) -> dict:
    """The records of a row with the old and the new code, `states` of the new one, and how far both are `apart`."""
    row: Row = ROWS[name]
    kept = [] if again else old.kept(name, steps)
    with tempfile.TemporaryDirectory(prefix=f"pdvol-{name}-") as folder:
        paths = {side: Path(folder) / side for side in ("old", "new")}
        codes = {"old": old.code, "new": lambda: REPOSITORY}
        sides = {
            side: lambda side=side: march.march(row, paths[side], steps, codes[side]())
            for side in paths
            if not (kept and side == "old")
        }
        records = {"old": kept, **march.in_turn(sides)}
        apart, states = None, "none"
        try:
            if not kept:
                old.keep(name, steps, records["old"], march.end(paths["old"]))
            new = march.end(paths["new"])
            distances = march.distances(old.end(name, steps), new)
            apart = None if distances is None else float(distances.max() / new["diagonal"])
            states = soundness(paths["new"], steps)
        except (PdvolError, OSError) as error:
            states = str(error)
    return {**records, "apart": apart, "states": states}


def soundness(path: Path, steps: int) -> str:
    """`sound`, or the first things wrong with the states, of which a hundred at most are searched."""
    problems = [text for found in verify.check_levels(path, max(1, steps // 100)) for text in found.problems]
    return "; ".join(problems[:2]) or "sound"


def sides(records: dict) -> dict:
    """The old and the new records."""
    return {side: records[side] for side in ("old", "new")}


def cells(name: str, records: dict) -> list[str]:
    """The cells of a row."""
    contacts = [some[0]["contacts"][-1] for some in sides(records).values() if some[0].get("contacts")]
    more = [march.same(contacts), number(records["apart"], 2), records["states"], records["commits"][1]]
    return [*march.versus(ROWS[name].title, sides(records)), *more]


def tabled(rows: dict) -> str:
    """Both tables."""
    old = ", ".join(sorted({records["commits"][0] for records in rows.values()}))
    head = f"Where two figures stand together, the first is that of {old}."
    split = march.by_part({ROWS[name].title: sides(records) for name, records in rows.items()})
    whole = table(HEAD, [cells(name, records) for name, records in rows.items()])
    return f"{head}\n\n{whole}\n\nMilliseconds a step by part:\n\n{split}"


if __name__ == "__main__":
    sys.exit(main())
