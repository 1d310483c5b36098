"""The rows of benchmarks.dense: which scene, for how many steps, and its goals; and their two tables.

A record is what one march left: `seconds`, `newton`, `linear`, `contacts` and `reached` are lists with an entry for
each step done, `parts` the sums of seconds by part, `tick` the mean of what a fixed loop took after each step [ms], and
`speed` that of the first body's centre at the end [m/s].
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from benchmarks.common import tables as markdown

PARTS = ("assembly", "contact", "ccd", "linear", "other")
MINUTES_20 = 1200.0


# ---- goals


def pace(record: dict, steps: int | None = None) -> float:
    """Seconds a step, of all steps or the first `steps`; the first one, with its set-up, only where it is alone."""
    seconds = record["seconds"][:steps]
    counted = seconds[1:] or seconds
    return sum(counted) / len(counted)


def faster(old: dict, new: dict) -> float:
    """Time of the old code over that of the new one, for the steps that both have done."""
    both = min(len(old["seconds"]), len(new["seconds"]))
    return pace(old, both) / pace(new, both)


def mean(values: list) -> float:
    """Their mean."""
    return sum(values) / len(values)


@dataclass(frozen=True)
class Goal:
    """One goal.

    Attributes
    ----------
    text : with braces for the goal's value
    measure : of the records of the old and the new code
    least : whether the goal's value is the smallest allowed; else it is the largest
    """

    text: str
    measure: Callable[[dict, dict], float]
    least: bool = False

    def verdict(self, goal: float, old: dict, new: dict) -> str:
        """The goal and what was measured, in bold where it is missed."""
        value = self.measure(old, new)
        met = value >= goal if self.least else value <= goal
        figure = markdown.number(value)
        return f"{self.text.format(f'{goal:g}')}: {figure if met else f'**{figure}**'}"


GOALS = {
    "faster": Goal("{} times as fast", faster, True),
    "ms": Goal("at most {} ms a step", lambda old, new: 1e3 * pace(new)),
    "mean": Goal("at most {} iterations", lambda old, new: mean(new["newton"])),
    "most": Goal("at most {} in the worst step", lambda old, new: max(new["newton"])),
    "share": Goal("at most {} of the iterations", lambda old, new: mean(new["newton"]) / mean(old["newton"])),
    "seconds": Goal("within {} s", lambda old, new: sum(new["seconds"])),
    "steps": Goal("at least {} steps", lambda old, new: len(new["seconds"]), True),
    "reached": Goal("`reached` at least {}", lambda old, new: min(new["reached"]), True),
    "speed": Goal("leaves at {} m/s or more", lambda old, new: new["speed"], True),
    "gain": Goal("two ranks {} times as fast as one", lambda old, new: new["gain"], True),
}


# ---- rows


@dataclass(frozen=True)
class Row:
    """One scene.

    Attributes
    ----------
    title : for the table
    file : the scene file, from the repository's root
    settings : of the scene
    steps : how many at most
    goals : values by the goals' names
    long : run only if named
    limit : CPU seconds after which the march stops [s]
    ranks : 2 marches it on one and on two ranks, by the wall clock
    """

    title: str
    file: str
    steps: int
    goals: dict
    settings: dict = field(default_factory=dict)
    long: bool = False
    limit: float = MINUTES_20
    ranks: int = 1


def dense(name: str, title: str, steps: int, goals: dict, **other) -> Row:
    """A row of dense/scenes.py."""
    return Row(title, "benchmarks/dense/scenes.py", steps, goals, {"name": name}, **other)


def peer(name: str, steps: int, goals: dict, **other) -> Row:
    """A row of peers/scenes.py."""
    return Row(f"`{name}`", "benchmarks/peers/scenes.py", steps, goals, {"name": name}, **other)


def squeeze(name: str, title: str, steps: int) -> Row:
    """A row of dense/squeezes.py, which needs the default model: compare it with 2440552 or later."""
    goals = {"mean": 15, "most": 60, "reached": 1}
    return Row(title, "benchmarks/dense/squeezes.py", steps, goals, {"name": name}, long=True)


def stress(name: str, steps: int, goals: dict, file: str = "stress", **other) -> Row:
    """A row of the stress tests or the envelope."""
    return Row(f"`{name}`", f"benchmarks/{file}/scenes.py", steps, goals, {"name": name}, long=True, **other)


ROWS = {
    "flight": Row(
        "`jelly_bowl` level 0, in free flight", "benchmarks/dense/scenes.py", 6, {"ms": 15}, {"name": "jelly_bowl"}
    ),
    "drop_500": peer("drop_500", 100, {"faster": 2}),
    "twistx_1k": peer("twistx_1k", 100, {"faster": 1.7}),
    "plates": dense("plates", "a block pressed between plates by 40 %", 40, {"faster": 1.7}),
    "blocks": peer("blocks", 60, {"faster": 2}),
    "drop_4k": peer("drop_4k", 100, {"faster": 1.7}),
    "stack": dense("stack", "five cubes stacked face on face", 100, {"faster": 5}),
    "balls": dense("balls", "27 balls between four walls", 80, {"faster": 3}),
    "jelly_bowl": dense("jelly_bowl", "`jelly_bowl` level 0", 60, {"faster": 6, "mean": 15, "most": 50}),
    **{f"impact_{speed}": peer(f"impact_{speed}", 20, {"share": 0.667}, long=True) for speed in (45, 100, 150)},
    **{
        f"struck_{speed}": dense(
            f"struck_{speed}",
            f"a rigid ball at {speed} m/s into a free cube",
            20,
            {"reached": 1, "most": 80, "speed": speed},
            long=True,
        )
        for speed in (15, 50)
    },
    "pin": squeeze("pin", "a rolling pin on dough", 56),
    "gears": squeeze("gears", "a block drawn between gears", 55),
    "piston": squeeze("piston", "a ball pressed in a cup", 50),
    "ring": squeeze("ring", "a bar pulled through a narrower ring", 40),
    "belts": squeeze("belts", "a ball carried between belts", 50),
    "capstan": squeeze("capstan", "a strap over a turning drum of eight sides", 40),
    "twist_20k": peer("twist_20k", 20, {"faster": 1.3}, long=True),
    "drop_20k": peer("drop_20k", 45, {"faster": 1.3}, long=True),
    "twist_100k": peer("twist_100k", 5, {"faster": 1.3}, long=True),
    "blocks_ranks": peer("blocks", 60, {"gain": 1.6}, ranks=2, long=True),
    "balls_ranks": dense("balls", "27 balls between four walls", 80, {"gain": 1.6}, ranks=2, long=True),
    "twist_20_turns": stress("twist_20_turns", 250, {"seconds": 120}, file="extremes"),
    "rods_twist": stress("rods_twist", 4000, {"steps": 1200}),
    "mat_twist": stress("mat_twist", 2500, {"steps": 700}),
    "trash_compactor": stress("trash_compactor", 250, {"steps": 250}, limit=1800.0),
}
"""By name, the cheap ones first."""


# ---- tables

HEAD = [
    "scene",
    "vertices",
    "steps (runs)",
    "goal: measured",
    "time a step [ms]",
    "tick [ms]",
    "Newton, mean (most)",
    "linear iterations a step",
    "contacts at the end",
    "farthest apart / diagonal",
    "states",
    "measured at",
]


def tables(pairs: dict[str, tuple[dict, dict]]) -> str:
    """Both tables, from the records of the old and the new code by row."""
    rows = [row(name, *pair) for name, pair in pairs.items()]
    parts = [
        [ROWS[name].title + both_ranks(name), *(f"{by_part(old, part)}, {by_part(new, part)}" for part in PARTS)]
        for name, (old, new) in pairs.items()
        if done(old) and done(new)
    ]
    split = markdown.table(["scene", *(f"{part} [ms]" for part in PARTS)], parts)
    return f"{markdown.table(HEAD, rows)}\n\nMilliseconds a step by part:\n\n{split}"


def row(name: str, old: dict, new: dict) -> list[str]:
    """The cells of a row; where two figures stand in one, the first is the old code's."""
    title = ROWS[name].title + both_ranks(name)
    failed = [f"{age}: {record['reason']}" for age, record in (("old", old), ("new", new)) if record["reason"]]
    if not (done(old) and done(new)):
        return [title, "", "", "; ".join(failed), *[""] * (len(HEAD) - 4)]
    goals = [GOALS[key].verdict(value, old, new) for key, value in ROWS[name].goals.items()]
    apart = new["apart"]
    return [
        title,
        f"{new['vertices']:,}",
        f"{pair(done(old), done(new))} ({pair(old['runs'], new['runs'])})",
        "; ".join(goals + failed),
        f"{markdown.number(1e3 * pace(old))}, {markdown.number(1e3 * pace(new))}",
        f"{old['tick']:.2f}, {new['tick']:.2f}",
        f"{iterations(old)}, {iterations(new)}",
        f"{markdown.number(mean(old['linear']))}, {markdown.number(mean(new['linear']))}",
        pair(old["contacts"][-1], new["contacts"][-1]),
        "-" if apart is None else markdown.number(apart, 2),
        new["states"],
        new["commit"][:7],
    ]


def done(record: dict) -> int:
    """Steps done."""
    return len(record["seconds"])


def pair(old: int, new: int) -> str:
    """Both, or one where they are the same."""
    return f"{old:,}" if old == new else f"{old:,}, {new:,}"


def iterations(record: dict) -> str:
    """`mean (most)` of the Newton iterations."""
    return f"{mean(record['newton']):.1f} ({max(record['newton'])})"


def by_part(record: dict, part: str) -> str:
    """Milliseconds a step, all steps counted."""
    return markdown.number(1e3 * record["parts"][part] / done(record), 2)


def both_ranks(name: str) -> str:
    """What the title of a row on two ranks adds."""
    return ", two ranks" if ROWS[name].ranks == 2 else ""
