"""`./run python -m demos.gallery.films [NAME ...]`: level 0 beside the finest one, larger than on the pages, of the
paper's 3D shots; and docs/films.md, the page that has them.

Films are made of the gallery's stored runs; a shot without one keeps its film.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from PIL import Image

from demos.gallery.entries import DEMOS, Entry
from demos.gallery.film import FRAMES_PER_SECOND, film_frames
from demos.gallery.page import RUNS
from demos.gallery.shots import costs, read_costs
from demos.gallery.shown import ENTRIES
from demos.gallery.simulation import note
from pdvol.errors import PdvolError
from pdvol.store.files import read_json, write_bytes, write_json
from pdvol.store.reader import Run, open_run
from pdvol.studio.draw.picture import render

PAGE = DEMOS.parent / "docs" / "films.md"
FRAME = (1280, 560)
"""Width and height of a film [pixels]: two panes, on a page that is 1280 wide on most screens."""
LOOK = {
    "leaf_sheep": "Look at where each one lands, and at the cerata, the leaves on their backs, in the current.",
    "jelly_bowl": "Look at who lies on whom at the end, and at the faces and paws of the finest level.",
    "bunny_noodles": "Look at the order of the slices, and at how folds become round.",
    "dice_and_wizard": "Look at the letter A: level 0 has a plain face there, and the finest level's gnome sinks in.",
    "twist": "Look at the moment of the release, and at the edges of the twisted bar.",
    "coil": "Look at the edges, which are pressed into the sides, and at the side to which the bar bends.",
    "ape": "Look at head and fist, up to the last second: levels simulated one by one lose this within two.",
}
"""The shots in the order of the page, and what to look at."""
TEASER, TEASER_AT = "leaf_sheep", 1.4
"""The shot of README's picture, and the moment [s]: both hang between mushroom and stone."""
ABOUT = """Level 0, which is the preview, beside the finest level of the same shot; where that pair is not drawn, all
levels beside each other. Each film plays at real speed, but for the moment that matters, which is in slow motion. The
[gallery](gallery/README.md) has all shots with all levels, and what each one costs."""
"""What stands above the films."""


def main(words: list[str]) -> int:
    """0 where all asked-for films were made, 1 where a run is missing or damaged, 2 for a wrong name."""
    parser = argparse.ArgumentParser(prog="python -m demos.gallery.films", description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"{', '.join(LOOK)}; none: the page alone")
    parser.add_argument("--runs", type=Path, default=DEMOS.parent / RUNS, help=f"folder of the runs (default: {RUNS})")
    options = parser.parse_args(words)
    wrong = [name for name in options.names if name not in LOOK]
    if wrong:
        print(f"gallery.films: there is no {wrong[0]}; choose of {', '.join(LOOK)}", file=sys.stderr)
        return 2
    try:
        for name in options.names:
            print(write_pair(name, options.runs / name, PAGE.parent / "films"))
        if TEASER in options.names:
            films = PAGE.parent / "films"
            print(write_teaser(options.runs / TEASER, films / f"{TEASER}.webp", films / "teaser.png"))
    except PdvolError as error:
        print(f"gallery.films: {error}", file=sys.stderr)
        return 1
    print(write_page(PAGE))
    return 0


def write_pair(name: str, folder: Path, out: Path) -> Path:
    """The film of a shot's stored run, with a note of its commits beside it.

    Raises
    ------
    InputError
        There is no run, or it has no two levels.
    """
    entry, run, finest = _shot(name, folder)
    out.mkdir(exist_ok=True)
    render(
        run,
        out / f"{name}.webp",
        [0, finest],
        film_frames(run.info["steps"], run.dt, entry.slow),
        size=FRAME,
        fps=FRAMES_PER_SECOND,
        turn=entry.turn,
        view=entry.view,
        cut=entry.cut,
    )
    levels = [level for level in costs(run) if level["level"] in (0, finest)]
    write_json(out / f"{name}.json", {"commits": note(run.path).get("commits", []), "levels": levels})
    return out / f"{name}.webp"


def write_teaser(folder: Path, film: Path, out: Path) -> Path:
    """README's picture: the frame of the teaser's `film` at one moment. Raises InputError as `write_pair` does."""
    entry, run, _ = _shot(TEASER, folder)
    frames = np.asarray(film_frames(run.info["steps"], run.dt, entry.slow))
    with Image.open(film) as picture:
        picture.seek(int(np.abs(frames - TEASER_AT / run.dt).argmin()))
        picture.convert("RGB").save(out)
    return out


def _shot(name: str, folder: Path) -> tuple[Entry, Run, int]:
    """A shot, its stored run, and its finest level."""
    entry, run = next(entry for entry in ENTRIES if entry.name == name), open_run(folder)
    return entry, run, run.levels[-1].index


def write_page(out: Path) -> Path:
    """The page: the pair of each shot, or its film of all levels where the pair is not drawn."""
    parts = ["# Films of the paper's 3D shots", ABOUT]
    for name, look in LOOK.items():
        film, page = out.parent / "films" / f"{name}.webp", out.parent / "gallery" / f"{name}.md"
        title = next(entry.title for entry in ENTRIES if entry.name == name)
        parts.append(f"## {title}")
        if film.is_file():
            kept = read_json(film.with_suffix(".json"))
            coarse, fine = kept["levels"]
            commits = ", ".join(commit[:7] for commit in kept["commits"])
            parts += [
                f"![{title}: level 0 beside level {fine['level']}](films/{name}.webp)",
                f"*{look} {_cost(coarse)}. {_cost(fine)}. At commit {commits}. [All levels](gallery/{name}.md).*",
            ]
        else:
            found = read_costs(page)
            sizes = ", ".join(f"{level['vertices']:,}" for level in found["levels"])
            parts += [
                f"![{title}: all levels](gallery/{name}.webp)",
                f"*{look} All levels: {sizes} vertices. At commit {found['commits']}. [Its page](gallery/{name}.md).*",
            ]
    write_bytes(out, ("\n\n".join(parts) + "\n").encode())
    return out


def _cost(level: dict) -> str:
    """Vertices and processor time of all steps of a level."""
    seconds = level["cpu"] * level["steps"]
    time = f"{seconds / 60:.0f} minutes" if seconds >= 120 else f"{seconds:.0f} s"
    return f"Level {level['level']}: {level['vertices']:,} vertices, {time}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
