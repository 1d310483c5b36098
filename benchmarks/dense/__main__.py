"""Dense contact and everyday scenes: rows in turn with an earlier commit, on one machine.

    ./run python -m benchmarks.dense [--scenes stack,balls | --long] [--against 97e899e]

Old and new code march the same scene file in turn, each run in a process of its own with one thread. Seconds are CPU
seconds of the steps, without start-up, storage and the first step, over the tick: the time of a fixed loop between
the steps. A core of a shared host runs at its best or at half of that.

The tables are written between the markers of NOTES.md beside this file; rows that are not run again stay. The exit code
is 0 when every run of the new code came to its end or its time limit and `pdvol verify` finds no wrong state, 1
otherwise.
"""

import sys
import tempfile
from functools import partial
from pathlib import Path

from benchmarks.common import commits, march
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import EVERYDAY, NAMES, ROWS, Row, chosen
from benchmarks.common.study import command
from benchmarks.common.tables import Kept, Page, number
from pdvol.errors import PdvolError
from pdvol.measure import verify

LONG = (*EVERYDAY, "impact", "struck", "pin", "gears", "piston", "ring", "belts", "capstan", "twist_20k", "drop_20k")
LONG += ("twist_100k", "twist_20_turns", "rods_twist", "mat_twist", "trash_compactor")
CODE = ("pdvol", "forms", "meshes")
"""The folders of the package."""
HEAD = [*march.HEAD, "contacts at the end", "farthest apart / diagonal", "states", "measured at"]


@command(
    "dense",
    __doc__,
    {
        "--scenes": {**NAMES, "help": f"rows: {', '.join(ROWS)} (default: the everyday ones)"},
        "--long": {"action": "store_true", "help": "the rows that take long, too: hours"},
        "--against": {"default": "97e899e", "metavar": "COMMIT", "help": "the old code (default: 97e899e)"},
        "--steps": {"type": int, "help": "so many steps at most, instead of each row's own"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "dense", "help": "for dense.json, the records"},
        "--docs": {"type": Path, "default": Path(__file__).with_name("NOTES.md"), "help": "where tables are kept"},
    },
)
def main(options) -> int:
    """Runs the command; returns its exit code."""
    names = chosen(options.scenes or (",".join(LONG) if options.long else ""), ROWS, EVERYDAY)
    repository = commits.Repository(REPOSITORY)
    kept = Kept(options.out / "dense.json", ROWS, HEAD, cells, Page(options.docs, "dense"), around)
    against = repository.full(options.against)
    with tempfile.TemporaryDirectory(prefix="pdvol-dense-") as folder:
        codes = {"old": code_of(repository, against, Path(folder)), "new": REPOSITORY}
        at = {"commits": [against[:7], repository.head()[:7]]}
        kept.run(names, lambda name: in_turn(ROWS[name], ROWS[name].most(options.steps), codes) | at)
    ended = [not any(run["reason"] for run in kept.rows[name]["new"]) for name in names]
    return int(not all(ended) or any(kept.rows[name]["states"] != "sound" for name in names))


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
        records = march.in_turn({side: partial(march.march, row, paths[side], steps, codes[side]) for side in codes})
        apart = None
        try:
            old, new = (march.end(path) for path in paths.values())
            distances = march.distances(old, new)
            apart = None if distances is None else float(distances.max() / new["diagonal"])
            found = verify.check_levels(paths["new"], max(1, steps // 100))  # a hundred states at most
            states = "; ".join([text for one in found for text in one.problems][:2]) or "sound"
        except PdvolError as error:
            states = str(error)
    return {**records, "apart": apart, "states": states}


def sides(records: dict) -> dict:
    """The old and the new records."""
    return {side: records[side] for side in ("old", "new")}


def cells(name: str, records: dict) -> list[list[str]]:
    """The cells of a row."""
    contacts = [some[0]["contacts"][-1] for some in sides(records).values() if some[0].get("contacts")]
    more = [march.same(contacts), number(records["apart"], 2), records["states"], records["commits"][1]]
    return [[*march.versus(ROWS[name].title, sides(records)), *more]]


def around(rows: dict) -> tuple[str, str]:
    """Which figures are those of the old code, and the table of seconds by part."""
    old = ", ".join(sorted({records["commits"][0] for records in rows.values()}))
    split = march.by_part({ROWS[name].title: sides(records) for name, records in rows.items()})
    above = f"Where two figures stand together, the first is that of {old}."
    return above, f"Milliseconds a step by part:\n\n{split}"


if __name__ == "__main__":
    sys.exit(main())
