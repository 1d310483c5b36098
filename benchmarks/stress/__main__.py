"""The classic stress tests of contact (scenes.py) under a limit of time each, and one table of the outcomes.

    ./run python -m benchmarks.stress [--scenes chain,erleben] [--minutes 20] [--out runs/stress] [--pictures]

Scenes already in the folder --out stay in the table. Each runs in a process of its own until its end, or until its
minutes of CPU time are over. `pdvol verify` checks every state. The exit code is 0 when every scene came to its end,
its time limit or a named error and no state is wrong, 1 otherwise.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from benchmarks.common import trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import NAMES, STRESS
from benchmarks.common.study import command
from benchmarks.stress import scenes
from pdvol.store.reader import open_run
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import renderer_by
from pdvol.studio.draw.layout import BACKGROUND, INK, font

SIZE, ABOVE = (300, 230), 30
"""Pixels of a picture, and of the name above it."""


@command(
    "stress",
    __doc__,
    {
        "--scenes": {**NAMES, "help": "by name or by its beginning (default: all)"},
        "--minutes": {"type": float, "default": 20.0, "help": "of CPU time, for each scene (default: 20)"},
        "--out": {"type": Path, "default": REPOSITORY / "runs" / "stress", "help": "for the table and pictures"},
        "--pictures": {"action": "store_true", "help": "draw each scene, and pictures.png of all"},
    },
)
def main(options) -> int:
    """Runs the command; returns its exit code."""
    keep = (lambda name, path: draw(path, options.out / f"{name}.png")) if options.pictures else (lambda *_: "")
    code = trials.run_all("stress", STRESS, scenes.SCENES, options, 60.0 * options.minutes, keep)
    if options.pictures:
        sheet(options.out, list(scenes.SCENES))
    return code


def draw(path: Path, picture: Path) -> str:
    """Draws the last moment of the finest level that has begun; there is nothing to note."""
    run = open_run(path)
    level = [level for level in run.levels if level.steps][-1]
    (camera, *_) = cameras_of_run(run, [level], [level.steps - 1], aspect=SIZE[0] / SIZE[1])
    with renderer_by(camera, SIZE) as renderer:
        Image.fromarray(np.asarray(renderer.picture(run, level, level.steps - 1))).save(picture)
    return ""


def sheet(folder: Path, names: list[str], columns: int = 4) -> None:
    """pictures.png: every scene that has been drawn, side by side, below its name."""
    drawn, (width, height) = [name for name in names if (folder / f"{name}.png").is_file()], SIZE
    page = Image.new("RGB", (columns * width, -(-len(drawn) // columns) * (height + ABOVE)), BACKGROUND)
    for k, name in enumerate(drawn):
        x, y = k % columns * width, k // columns * (height + ABOVE)
        page.paste(Image.open(folder / f"{name}.png"), (x, y + ABOVE))
        ImageDraw.Draw(page).text((x + width / 2, y + ABOVE / 2), name.replace("_", " "), INK, font(15), anchor="mm")
    page.save(folder / "pictures.png", optimize=True)


if __name__ == "__main__":
    sys.exit(main())
