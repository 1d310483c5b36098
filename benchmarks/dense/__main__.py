"""Dense contact and everyday scenes: rows in turn with an earlier commit, on one machine.

    ./run python -m benchmarks.dense [--scenes stack,balls | --long] [--against 97e899e]

Old and new code march the same scene file in turn, each run in a process of its own with one thread: up to three runs
of each, fewer once they have taken a minute together; the median counts. Seconds are CPU seconds (user and system) of
the steps themselves, without start-up, storage and the first step, so that other work on the machine does not count.
Times are divided by the tick, the time of a fixed loop between the steps: a core of a shared host runs at its best or
at half of that.

The tables are written between the markers of NOTES.md beside this file; rows that are not run again stay. The exit code
is 0 when every run of the new code came to its end or its time limit and `pdvol verify`'s check finds no wrong state, 1
otherwise, and 2 for a wrong command line.
"""

import sys
import tempfile
from pathlib import Path

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
    add("--steps", type=int, help="so many steps at most, instead of each row's own")
    add("--out", type=Path, default=REPOSITORY / "runs" / "dense", metavar="DIR", help="for dense.json, the records")
    page = Path(__file__).with_name("NOTES.md")
    add("--docs", type=Path, default=page, metavar="FILE", help="where the tables are kept")
    options = parser.parse_args(words)
    try:
        names = chosen(options.scenes or (",".join(LONG) if options.long else ""), ROWS, EVERYDAY)
        repository = commits.Repository(REPOSITORY)
        against = repository.full(options.against)
        kept = Kept(options.out / "dense.json", ROWS, tabled, Page(options.docs, "dense"))
    except (process.Mistake, commits.MissingObject, OSError) as error:
        print(f"benchmarks.dense: {error}", file=sys.stderr)
        return 2
    ended_well = True
    with tempfile.TemporaryDirectory(prefix="pdvol-dense-") as folder:
        codes = {"old": code_of(repository, against, Path(folder)), "new": REPOSITORY}
        for name in names:
            steps = min(options.steps or ROWS[name].steps, ROWS[name].steps)
            records = in_turn(ROWS[name], steps, codes) | {"commits": [against[:7], repository.head()[:7]]}
            ended_well &= not any(run["reason"] for run in records["new"]) and records["states"] == "sound"
            kept.add(name, records)
            print(" | ".join(cells(name, records)), file=sys.stderr, flush=True)
    print(kept)
    return int(not ended_well)


def code_of(repository: commits.Repository, commit: str, folder: Path) -> Path:
    """Writes the package of a commit into a folder; that folder."""
    repository.write(commit, CODE, folder)
    for name in CODE[1:]:  # an editable install would find this repository's own
        if (folder / name).is_dir():
            (folder / "pdvol" / name).symlink_to(Path("..") / name)
    return folder


def in_turn(row: Row, steps: int, codes: dict[str, Path]) -> dict:
    """The records of a row with the old and the new code, `states` of the new one, and how far both are `apart`."""
    with tempfile.TemporaryDirectory(prefix="pdvol-dense-") as folder:
        paths = {side: Path(folder) / side for side in codes}
        runs = {side: lambda side=side: march.march(row, paths[side], steps, codes[side]) for side in codes}
        records, apart = march.in_turn(runs), None
        try:
            old, new = (march.end(path) for path in paths.values())
            distances = march.distances(old, new)
            apart = None if distances is None else float(distances.max() / new["diagonal"])
            states = soundness(paths["new"], steps)
        except PdvolError as error:
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
