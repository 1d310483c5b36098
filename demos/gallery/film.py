"""Film, picture and tile of an entry, and the contact sheet: as small as the repository may carry them.

`./run python -m demos.gallery.film FILE ...` makes other films and pictures as small.
"""

import io
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from demos.gallery.entries import Entry
from pdvol.store.files import write_bytes
from pdvol.store.reader import Run
from pdvol.studio.draw.compose import Grid, Pane, composed
from pdvol.studio.draw.film import film_steps
from pdvol.studio.draw.film import write_film as encode
from pdvol.studio.draw.layout import BACKGROUND, INK, font, write_png
from pdvol.studio.draw.picture import FILM_HEADER, chosen_steps, film_pane, render
from pdvol.studio.draw.views import Shot

FRAMES_PER_SECOND = 24.0
PAUSE = 0.75  # s that the last state stands before a film begins again
TRIALS = (
    (960, 2, 60),
    (880, 2, 40),
    (720, 2, 40),
    (800, 3, 40),
    (720, 3, 35),
    (720, 4, 35),
    (640, 4, 35),
    (560, 5, 30),
    (480, 6, 25),
)
"""Width of a film [pixels], how many frames become one, and the quality of 100: the first that fits is taken."""
MOST_FRAMES = 120  # of a film with direct levels: more do not fit into its bytes
MOMENTS, PANE = 3, 200  # of a picture with direct levels: moments, and the width of a level in it [pixels]
WIDEST, COLOURS = 880, 64  # pixels, of a picture in the repository; a sixth of the bytes of true colour
TILE, LABEL, SHEET_COLUMNS = (300, 225), 30, 4  # pixels, of a demo on the contact sheet and of its title; tiles a row


def film_frames(steps: int, dt: float, slow: tuple[float, float] | None) -> list[int]:
    """The step that each frame shows: real speed, but for `slow`, whose stored states are a frame each; then a pause.

    Parameters
    ----------
    steps : the run's last step
    dt : [s]
    slow : first and last second in slow motion; states further apart than frames leave nothing to slow down
    """
    if slow is None or dt * FRAMES_PER_SECOND >= 1.0:
        frames = film_steps(0, steps, dt, FRAMES_PER_SECOND)
    else:
        begin, end = (min(round(second / dt), steps) for second in slow)
        before = [step for step in film_steps(0, begin, dt, FRAMES_PER_SECOND) if step < begin]
        frames = [*before, *range(begin, end), *film_steps(end, steps, dt, FRAMES_PER_SECOND)]
    return frames + [steps] * round(PAUSE * FRAMES_PER_SECOND)


def write_film(entry: Entry, run: Run, out: Path, direct: Run | None = None) -> Path:
    """The levels beside each other, as an animated WebP, which a page shows like a picture; those of a run by the
    direct method above them, where the film is short.
    """
    steps = film_frames(run.info["steps"], run.dt, entry.slow)
    if direct is None or len(steps) > MOST_FRAMES:
        shot = replace(seen(entry), size=entry.size, fps=FRAMES_PER_SECOND)
        return fit_film(render(run, out, steps=steps, shot=shot), entry.most)
    panes, columns = both(run, direct)
    grid = Grid(len(panes), columns, above=FILM_HEADER).filling(entry.size)
    return fit_film(encode(out, composed(panes, steps, seen(entry), grid), FRAMES_PER_SECOND), entry.most)


def write_picture(entry: Entry, run: Run, out: Path, direct: Run | None = None) -> Path:
    """Rows are levels, columns are moments. With a run by the direct method, columns are levels, and each of `MOMENTS`
    moments has a row of direct levels above one of refined ones.
    """
    if direct is None:
        return fit_picture(render(run, out, shot=replace(seen(entry), width=260)))
    panes, columns = both(run, direct)
    steps = chosen_steps(run.levels[0], run.info["steps"], MOMENTS + 1)[1:]
    order = [[k for k in range(MOMENTS) for _ in panes]]
    grid = Grid(MOMENTS * len(panes), columns, above=FILM_HEADER)
    write_png(out, next(composed(panes * MOMENTS, steps, replace(seen(entry), width=PANE), grid, order)))
    return fit_picture(out)


def both(run: Run, direct: Run) -> tuple[list[Pane], int]:
    """The direct levels, then the refined ones, with words above each; and how many levels there are."""
    named = ((direct, "direct"), (run, "refined"))
    count = min(len(each.levels) for each, _ in named)
    panes = [
        film_pane(each, level, f"level {level.index}", f"{name}, {len(level.rest):,} vertices")
        for each, name in named
        for level in each.levels[:count]
    ]
    return panes, count


def seen(entry: Entry) -> Shot:
    """How pictures and films show an entry."""
    return Shot(entry.view, entry.turn, entry.cut)


def write_binding(run: Run, out: Path) -> Path:
    """How level 1 is bound to level 0; finer pairs (`pdvol info --pictures`) have more dots than a page can show."""
    from mpi4py import MPI

    from pdvol.levels.hierarchy import Hierarchy
    from pdvol.studio.draw.bindings import draw_binding

    pair = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF, run.info["prolongation"]).prolongation(1)
    up = run.info.get("up") or (0.0, 0.0, 1.0)
    title = f"levels 0 -> 1, {run.info['prolongation']}"
    draw_binding(out, pair.coarse.mesh, pair.fine.mesh, pair.binding.cells, pair.weights(), title, up)
    return fit_picture(out)


def write_tile(entry: Entry, run: Run, entries: Sequence[Entry], sheet: Path) -> Path:
    """The finest level at the entry's moment in its place of the contact sheet, its title below; other tiles stay."""
    step = min(round(entry.moment / run.dt), run.info["steps"])
    level = next(level for level in reversed(run.levels) if level.steps > step)
    tile = next(composed([Pane(run, level)], [step], seen(entry), Grid(1, 1, TILE)))
    return place_tile(tile, entry.title, [each.title for each in entries], sheet)


def place_tile(tile: Image.Image, title: str, titles: Sequence[str], sheet: Path) -> Path:
    """Put a tile on the contact sheet of all `titles`, which begins empty where there is none of its size."""
    columns, height = min(SHEET_COLUMNS, len(titles)), TILE[1] + LABEL
    picture = Image.new("RGB", (columns * TILE[0], -(-len(titles) // columns) * height), BACKGROUND)
    if sheet.is_file():
        with Image.open(sheet) as before:
            if before.size == picture.size:
                picture.paste(before.convert("RGB"))
    place = titles.index(title)
    x, y = place % columns * TILE[0], place // columns * height
    picture.paste(tile.convert("RGB").resize(TILE), (x, y))
    picture.paste(BACKGROUND, (x, y + TILE[1], x + TILE[0], y + height))
    middle = (x + TILE[0] / 2, y + TILE[1] + LABEL / 2)
    ImageDraw.Draw(picture).text(middle, title.replace("_", " "), INK, font(14), anchor="mm")
    picture.save(sheet)
    return fit_picture(sheet, picture.width, 128)


def fit_picture(path: Path, widest: int = WIDEST, colours: int = COLOURS) -> Path:
    """Make a PNG as wide and of as many colours as the repository may carry, where that takes bytes away."""
    with Image.open(path) as picture:
        size = (min(widest, picture.width), round(picture.height * min(widest, picture.width) / picture.width))
        shown = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    found = io.BytesIO()
    # Only with a palette that is there does Pillow spread what colours lack: soft shadows must not have steps.
    few = shown.quantize(palette=shown.quantize(colours), dither=Image.Dither.FLOYDSTEINBERG)
    few.save(found, "PNG", optimize=True)
    if found.tell() < path.stat().st_size:
        write_bytes(path, found.getvalue())
    return path


def fit_film(path: Path, most: int = Entry.most) -> Path:
    """Make an animated WebP at most so many bytes large: narrower, with fewer frames and coarser, no more than needed.
    Where no trial fits, the last one is kept.
    """
    if path.stat().st_size <= most:
        return path
    with Image.open(path) as film:
        for width, every, quality in TRIALS:
            found, (frames, times) = io.BytesIO(), zip(*_frames(film, width, every), strict=True)
            words: dict[str, Any] = {"save_all": True, "append_images": frames[1:], "duration": times, "loop": 0}
            frames[0].save(found, "WEBP", **words, quality=quality, method=4)
            if found.tell() <= most:
                break
    write_bytes(path, found.getvalue())
    return path


def _frames(film: Image.Image, width: int, every: int) -> Iterator[tuple[Image.Image, int]]:
    """One of so many frames of a film, and the time [ms] of all of them."""
    size = (min(width, film.width), round(film.height * min(width, film.width) / film.width))
    count = getattr(film, "n_frames", 1)
    for first in range(0, count, every):
        time = 0
        for k in reversed(range(first, min(first + every, count))):
            film.seek(k)
            film.load()
            time += film.info["duration"]
        yield film.convert("RGB").resize(size, Image.Resampling.LANCZOS), time


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print((fit_film if name.endswith(".webp") else fit_picture)(Path(name)))
