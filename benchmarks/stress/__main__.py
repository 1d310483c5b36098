"""The classic stress tests of contact (scenes.py) under a limit of time each, and one table of the
outcomes.

    ./run python -m benchmarks.stress [--scenes chain,erleben] [--minutes 20] [--out runs/stress] [--pictures]

Scenes are named in full or by their first letters; scenes already in the folder --out stay in the table. Each runs in a
process of its own until its end, or until it is stopped between two steps when its minutes are over. `pdvol verify`
checks every state for intersections and inverted cells. The exit code is 0 when every scene came to its end or its time
limit and no state is wrong, 1 otherwise, and 2 for a wrong command line.
"""

import sys
from pathlib import Path

from benchmarks.common import process, trials
from benchmarks.common.process import REPOSITORY
from benchmarks.common.tables import table

FILE = Path(__file__).with_name("scenes.py")
HEAD = [
    "scene",
    "vertices",
    "cells",
    "dt [s]",
    "dhat [m]",
    "eps_v [m/s]",
    "tolerance [m/s]",
    "steps done",
    "outcome",
    "contacts mean (most)",
    "Newton mean (most)",
    "cuts",
    "smallest gap [m]",
    "smallest det F",
    "time a step [s]",
    "memory [MB]",
]


def main(words: list[str] | None = None) -> int:
    """Runs the command; returns its exit code."""
    parser = process.parser("stress", __doc__)
    parser.add_argument(
        "--scenes", default="", metavar="NAME,...", help="scenes by name or by how their names begin (default: all)"
    )
    parser.add_argument("--minutes", type=float, default=20.0, help="for each scene (default: 20)")
    parser.add_argument(
        "--out",
        type=Path,
        default=REPOSITORY / "runs" / "stress",
        metavar="DIR",
        help="for stress.json, stress.md and pictures",
    )
    parser.add_argument("--pictures", action="store_true", help="draw each scene, and pictures.png of all")
    options = parser.parse_args(words)
    try:
        from benchmarks.stress import scenes

        names = trials.chosen(options.scenes, scenes.SCENES)
        kept = trials.Trials(options.out, "stress", scenes.SCENES, names, tabled)
    except (process.Mistake, OSError) as error:
        print(f"benchmarks.stress: {error}", file=sys.stderr)
        return 2
    seconds = 60.0 * options.minutes
    for name in names:
        keep = (lambda path, name=name: draw(path, options.out / f"{name}.png")) if options.pictures else None
        record = trials.trial(FILE, name, seconds, seconds + trials.PATIENCE + 0.5 * seconds, keep)
        record["lengths"] = trials.lengths(scenes.scene(name), record.get("diagonal", 1.0))
        kept.add(record, " | ".join(" | ".join(row) for row in rows(record)))
    if options.pictures:
        sheet(options.out, list(scenes.SCENES))
    print(kept)
    return int(not all(trials.sound(record) and record["outcome"] in ("done", "time") for record in kept.records))


def draw(path: Path, picture: Path) -> None:
    """Draws three moments of the finest level that has begun."""
    from pdvol.store.reader import open_run
    from pdvol.studio.draw.picture import render

    run = open_run(path)
    level = [level for level in run.levels if level.steps][-1]
    render(run, picture, [level.index], sorted({0, (level.steps - 1) // 2, level.steps - 1}), cell_width=360, turn=25.0)


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


def tabled(records: list[dict]) -> str:
    """The table, with one row per level."""
    return table(HEAD, [row for record in records for row in rows(record)])


def rows(record: dict) -> list[list[str]]:
    """The rows of one record, one per level."""
    ends = {"done": "full time", "time": "time limit", "hang": "ended by the clock"}
    outcome = ends.get(record["outcome"], record["outcome"]) + (", states wrong" if record["problems"] else "")
    begun = [level for level in record["levels"] if level["newton"]["mean"] is not None]
    if not begun:
        return [[record["name"], *[""] * 7, outcome, *[""] * 7]]
    found = []
    for level in begun:
        name = record["name"] if len(record["levels"]) == 1 else f"{record['name']}, level {level['level']}"
        steps = level["steps"]
        whole = steps == record["steps"] and not record["problems"]
        lengths = (trials.number(record["lengths"][k]) for k in ("dhat", "eps_v", "tolerance"))
        found.append(
            [
                name,
                f"{level['vertices']:,}",
                f"{level['cells']:,}",
                f"{record['dt']:g}",
                *lengths,
                f"{steps:,} of {record['steps']:,}",
                "full time" if whole else outcome,
                both(level["contacts"], 0),
                both(level["newton"], 1),
                str(level["cuts"]),
                trials.number(level["gap_min"]),
                trials.number(level["det_f_min"]),
                trials.number(level["seconds"] / max(steps, 1)),
                f"{record.get('peak_memory_mb') or level['memory_log_mb']:.0f}",
            ]
        )
    return found


def both(values: dict, digits: int) -> str:
    """`mean (most)`."""
    return f"{values['mean']:.{digits}f} ({values['max']})"


if __name__ == "__main__":
    sys.exit(main())
