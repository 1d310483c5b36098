"""The scenes whose ranks are measured, and the words for pdvol that run them."""

import shutil
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.common import process


@dataclass(frozen=True)
class Row:
    """One scene.

    Attributes
    ----------
    title : for the table
    file : the scene file, from the repository's root
    steps : of the run; the first one, with its set-up, does not count
    settings : of the scene
    level : the one that is timed
    """

    title: str
    file: str
    steps: int
    settings: dict = field(default_factory=dict)
    level: int = 0


def peer(name: str, steps: int) -> Row:
    """A row of peers/scenes.py."""
    return Row(f"`{name}`", "benchmarks/peers/scenes.py", steps, {"name": name})


ROWS = {
    "drop_500": peer("drop_500", 60),
    "twistx_1k": peer("twistx_1k", 60),
    "jelly_bowl": Row("`jelly_bowl` level 0", "benchmarks/dense/scenes.py", 40, {"name": "jelly_bowl"}),
    "drop_4k": peer("drop_4k", 60),
    "blocks": peer("blocks", 40),
    "balls": Row("27 balls between four walls", "benchmarks/dense/scenes.py", 40, {"name": "balls"}),
    "twist_20k": peer("twist_20k", 15),
    "drop_20k": peer("drop_20k", 30),
    "twist_100k": peer("twist_100k", 5),
    "twist_300k": peer("twist_300k", 5),
    "twist_1m": peer("twist_1m", 10),
    "leaf_sheep": Row("`leaf_sheep` level 2", "demos/leaf_sheep.py", 10, level=2),
    "jelly_bowl_1": Row("`jelly_bowl` level 1", "demos/jelly_bowl.py", 25, level=1),
    "jelly_bowl_2": Row("`jelly_bowl` level 2", "demos/jelly_bowl.py", 12, level=2),
    "noodles": Row("`bunny_noodles` level 2", "demos/bunny_noodles.py", 15, level=2),
}


def words_of(row: Row, out: Path) -> list[str]:
    """The words for pdvol that run a row into a folder."""
    shutil.rmtree(out, ignore_errors=True)
    settings = [word for name, value in row.settings.items() for word in ("--set", f"{name}={value}")]
    words = ["run", process.REPOSITORY / row.file, "--levels", f"0:{row.level}", "--steps", row.steps]
    return [str(word) for word in (*words, "--out", out, "--no-picture", "--no-xdmf", *settings)]
