"""The rows of the table beside STARK, what a run leaves, and the table.

A record is what one run left: `seconds` (CPU seconds), `newton` and `dt` [s] are lists with an entry for each step that
was taken, `tick` is the mean of what a fixed loop took after each step [ms], `vertices` and `inverted` count, and
`reason` says why a run did not come to its end.
"""

from dataclasses import dataclass
from statistics import median

from benchmarks.common.tables import number, table

SYSTEMS = ("stark", "pdvol")
PEERS, PILES = "benchmarks/peers/scenes.py", "benchmarks/dense/scenes.py"
HEAD = [
    "scene",
    "vertices",
    "steps (runs)",
    "STARK's time over pdvol's (run by run)",
    "STARK [ms a step]",
    "pdvol [ms a step]",
    "tick [ms]: STARK, pdvol",
    "Newton a step: STARK, pdvol",
    "smallest step of STARK [ms]",
    "inverted cells at the end: STARK, pdvol",
    "last positions apart [mm]: median, most",
    "load",
    "measured at",
]


@dataclass(frozen=True)
class Row:
    """One scene.

    Attributes
    ----------
    title : for the table
    file : the scene file, from the repository's root
    settings : of the scene
    steps : how many of its steps
    long : run only if named
    """

    title: str
    file: str
    settings: dict
    steps: int
    long: bool = False


def peer(name: str, steps: int = 100, long: bool = False) -> Row:
    """A row of the peers' scenes."""
    return Row(f"`{name}`", PEERS, {"name": name}, steps, long)


ROWS = {
    "drop_500": peer("drop_500"),
    "twist_1k": peer("twist_1k"),
    "twistx_1k": peer("twistx_1k"),
    "twist_4k": peer("twist_4k"),
    "drop_4k": peer("drop_4k"),
    "blocks": peer("blocks", 60),
    "stack": Row("five cubes face on face", PILES, {"name": "stack"}, 100),
    "balls": Row("a heap of 27 balls", PILES, {"name": "balls"}, 80),
    "rollers": Row("a block drawn through two rollers", PILES, {"name": "rollers"}, 60),
    "twist_20k": peer("twist_20k", 20, long=True),
    "drop_20k": peer("drop_20k", 45, long=True),
}
"""By name, the cheap ones first."""


# ---- figures of a record


def pace(record: dict) -> float:
    """CPU seconds for a time step of the scene. The first step, with its set-up, counts only where it is alone."""
    return per_step(record, "seconds", 1 if len(record["seconds"]) > 1 else 0)


def per_step(record: dict, key: str, first: int = 0) -> float:
    """Mean of `key` for a time step of the scene, from step `first` on: STARK may have cut steps."""
    return sum(record[key][first:]) * max(record["dt"]) / sum(record["dt"][first:])


def ticks(record: dict) -> float:
    """The pace in ticks, by which the speed of the core drops out."""
    return 1e3 * pace(record) / record["tick"]


def ratios(records: dict[str, list[dict]]) -> tuple[float, list[float]]:
    """STARK's time over pdvol's, of the medians and run by run."""
    taken = [[ticks(record) for record in records[system]] for system in SYSTEMS]
    each = [theirs / ours for theirs, ours in zip(*taken, strict=True)]
    return median(taken[0]) / median(taken[1]), each


# ---- the table


def tabled(rows: dict[str, dict[str, list[dict]]]) -> str:
    """The table of all rows that were run."""
    return table(HEAD, [cells(name, rows[name]) for name in ROWS if name in rows])


def cells(name: str, records: dict[str, list[dict]]) -> list[str]:
    """The cells of a row; where a run failed, why."""
    title = ROWS[name].title
    failed = {system: run["reason"] for system in SYSTEMS for run in records[system] if run["reason"]}
    if failed:
        reasons = "; ".join(f"{system} failed: {reason}" for system, reason in failed.items())
        return [title, "", "", reasons, *[""] * (len(HEAD) - 4)]
    theirs, ours = (records[system] for system in SYSTEMS)
    ratio, each = ratios(records)
    apart = ours[0]["apart"]
    loads = [run["load"] for run in [*theirs, *ours]]
    return [
        title,
        f"{ours[0]['vertices']:,}",
        f"{len(ours[0]['seconds'])} ({len(ours)})",
        f"{number(ratio)} ({', '.join(number(one) for one in each)})",
        *(number(1e3 * median(pace(run) for run in runs)) for runs in (theirs, ours)),
        pair(*(f"{median(run['tick'] for run in runs):.2f}" for runs in (theirs, ours))),
        pair(*(f"{per_step(runs[0], 'newton'):.1f}" for runs in (theirs, ours))),
        number(1e3 * min(min(run["dt"]) for run in theirs), 2),
        pair(*(str(max(run["inverted"] for run in runs)) for runs in (theirs, ours))),
        pair(*(number(1e3 * one, 2) for one in apart)),
        f"{min(loads):.1f} to {max(loads):.1f}",
        ours[-1]["commit"][:7],
    ]


def pair(theirs: str, ours: str) -> str:
    """Both, STARK's first."""
    return f"{theirs}, {ours}"
