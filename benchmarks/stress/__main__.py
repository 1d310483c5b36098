"""The classic stress tests of contact (scenes.py) under a limit of time each, and one table of the outcomes.

    ./run python -m benchmarks.stress [--scenes chain,erleben] [--minutes 20] [--out runs/stress] [--pictures]

Scenes are named in full or by their first letters; scenes already in the folder --out stay in the table. Each runs in a
process of its own until its end, or until it is stopped between two steps when its minutes of CPU time are over.
`pdvol verify` checks every state for intersections and inverted cells. The exit code is 0 when every scene came to its
end, its time limit or a named error and no state is wrong, 1 otherwise, and 2 for a wrong command line.
"""

import sys
from pathlib import Path

from benchmarks.common import process, trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.rows import STRESS
from benchmarks.stress import scenes


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("stress", __doc__)
    add = parser.add_argument
    add("--scenes", default="", metavar="NAME,...", help="by name or by its beginning (default: all)")
    add("--minutes", type=float, default=20.0, help="of CPU time, for each scene (default: 20)")
    add("--out", type=Path, default=REPOSITORY / "runs" / "stress", metavar="DIR", help="for the table and pictures")
    add("--pictures", action="store_true", help="draw each scene, and pictures.png of all")
    options = parser.parse_args(words)
    keep = (lambda name, path: draw(path, options.out / f"{name}.png")) if options.pictures else (lambda *_: "")
    code = trials.run_all("stress", STRESS, scenes.SCENES, options, 60.0 * options.minutes, keep)
    if options.pictures and code < 2:
        sheet(options.out, list(scenes.SCENES))
    return code


def draw(path: Path, picture: Path) -> str:
    """Draws three moments of the finest level that has begun; there is nothing to note."""
    from pdvol.store.reader import open_run
    from pdvol.studio.draw.picture import render
    from pdvol.studio.draw.views import Shot

    run = open_run(path)
    level = [level for level in run.levels if level.steps][-1]
    steps = sorted({0, (level.steps - 1) // 2, level.steps - 1})
    render(run, picture, [level.index], steps, Shot(turn=25.0, width=360))
    return ""


def sheet(folder: Path, names: list[str], columns: int = 4, width: int = 300, height: int = 260) -> None:
    """pictures.png: the last moment of every scene that has been drawn, side by side."""
    from PIL import Image, ImageDraw

    from pdvol.studio.draw.layout import BACKGROUND, INK, font

    drawn = [name for name in names if (folder / f"{name}.png").is_file()]
    page = Image.new("RGB", (columns * width, -(-len(drawn) // columns) * height), BACKGROUND)
    for k, name in enumerate(drawn):
        picture = Image.open(folder / f"{name}.png")
        last = picture.crop((picture.width - 368, 42, picture.width - 8, picture.height - 8))
        last.thumbnail((width - 10, height - 40))
        x, y = k % columns * width, k // columns * height
        page.paste(last, (x + (width - last.width) // 2, y + 30 + (height - 30 - last.height) // 2))
        ImageDraw.Draw(page).text((x + width / 2, y + 16), name.replace("_", " "), INK, font(15), anchor="mm")
    page.save(folder / "pictures.png", optimize=True)


if __name__ == "__main__":
    sys.exit(main())
