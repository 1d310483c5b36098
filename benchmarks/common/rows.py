"""The rows that several studies march: a scene file, its settings and steps."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from benchmarks.common.process import Mistake

SCENES = "benchmarks/common/scenes"


@dataclass(frozen=True)
class Row:
    """One scene.

    Attributes
    ----------
    title : for the table
    file : the scene file, from the repository's root
    steps : how many at most; all of the scene's for None
    settings : of the scene
    level : the one that is timed; those below it are marched before
    limit : CPU seconds after which the march stops [s]
    """

    title: str
    file: str
    steps: int | None
    settings: dict = field(default_factory=dict)
    level: int = 0
    limit: float = 1200.0

    def most(self, steps: int | None) -> int | None:
        """The row's steps, or `steps` where these are fewer."""
        return min((count for count in (self.steps, steps) if count is not None), default=None)


def scene(name: str, steps: int | None, file: str = f"{SCENES}/peers.py", title: str = "", **more) -> Row:
    """A row of a file with many scenes."""
    return Row(title or f"`{name}`", file, steps, {"name": name}, **more)


def pile(name: str, steps: int, title: str = "") -> Row:
    """A row of scenes/piles.py."""
    return scene(name, steps, f"{SCENES}/piles.py", title)


def squeeze(name: str, steps: int, title: str) -> Row:
    """A row of scenes/squeezes.py, which needs the default model: compare it with 2440552 or later."""
    return scene(name, steps, f"{SCENES}/squeezes.py", title)


STRESS, EXTREMES = "benchmarks/stress/scenes.py", "benchmarks/extremes/scenes.py"
ROWS = {
    "flight": pile("jelly_bowl", 6, "`jelly_bowl` level 0, in free flight"),
    "drop_500": scene("drop_500", 100),
    "twist_1k": scene("twist_1k", 100),
    "twistx_1k": scene("twistx_1k", 100),
    "rollers": pile("rollers", 60, "a block drawn through two rollers"),
    "octopus": pile("octopus", 40, "an octopus drawn through two rollers"),
    "octopus_2": pile("octopus_2", 40, "the same octopus, finer"),
    "plates": pile("plates", 40, "a block pressed between plates by 40 %"),
    "twist_4k": scene("twist_4k", 100),
    "blocks": scene("blocks", 60),
    "drop_4k": scene("drop_4k", 100),
    "stack": pile("stack", 100, "five cubes stacked face on face"),
    "balls": pile("balls", 80, "27 balls between four walls"),
    "jelly_bowl": pile("jelly_bowl", 60, "`jelly_bowl` level 0"),
    **{f"impact_{speed}": scene(f"impact_{speed}", 20) for speed in (45, 100, 150)},
    **{
        f"struck_{speed}": pile(f"struck_{speed}", 20, f"a rigid ball at {speed} m/s into a free cube")
        for speed in (15, 50)
    },
    "pin": squeeze("pin", 56, "a rolling pin on dough"),
    "gears": squeeze("gears", 55, "a block drawn between gears"),
    "piston": squeeze("piston", 50, "a ball pressed in a cup"),
    "ring": squeeze("ring", 40, "a bar pulled through a narrower ring"),
    "belts": squeeze("belts", 50, "a ball carried between belts"),
    "capstan": squeeze("capstan", 40, "a strap over a turning drum of eight sides"),
    "twist_20k": scene("twist_20k", 20),
    "drop_20k": scene("drop_20k", 45),
    "twist_100k": scene("twist_100k", 5),
    "twist_300k": scene("twist_300k", 5),
    "twist_1m": scene("twist_1m", 10),
    "twist_20_turns": scene("twist_20_turns", 250, EXTREMES),
    "rods_twist": scene("rods_twist", 4000, STRESS),
    "mat_twist": scene("mat_twist", 2500, STRESS),
    "trash_compactor": scene("trash_compactor", 250, STRESS, limit=1800.0),
    "jelly_bowl_1": Row("`jelly_bowl` level 1", "demos/jelly_bowl.py", 25, level=1),
    "jelly_bowl_2": Row("`jelly_bowl` level 2", "demos/jelly_bowl.py", 12, level=2),
    "noodles": Row("`bunny_noodles` level 2", "demos/bunny_noodles.py", 15, level=2),
    "leaf_sheep": Row("`leaf_sheep` level 2", "demos/leaf_sheep.py", 10, level=2),
}
"""By name, the cheap ones first."""
EVERYDAY = ("flight", "drop_500", "twistx_1k", "plates", "blocks", "drop_4k", "stack", "balls", "jelly_bowl")
"""What runs unless other rows are named."""
NAMES = {"default": "", "metavar": "NAME,..."}
"""Of an option that takes names, for `chosen`."""


def chosen(text: str, known: Iterable[str], usual: Iterable[str] | None = None) -> list[str]:
    """Names from names and beginnings of names, each once; the usual ones when the text is empty, or else all."""
    known, names = list(known), []
    for word in filter(None, text.split(",")):
        fitting = [word] if word in known else [name for name in known if name.startswith(word)]
        if not fitting:
            raise Mistake(f"there is no {word!r}; choose from {', '.join(known)}")
        names += fitting
    return list(dict.fromkeys(names)) or list(known if usual is None else usual)
