"""Film, picture and tile of an entry, and the contact sheet of all tiles."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from demos.gallery.entries import Entry
from pdvol.store.reader import Run
from pdvol.studio.draw.film import film_steps
from pdvol.studio.draw.layout import BACKGROUND, INK, font
from pdvol.studio.draw.picture import render

FRAMES_PER_SECOND = 24.0
PAUSE = 0.75  # s that the last state stands before a film begins again
TILE = (400, 300)  # pixels, of a demo on the contact sheet
LABEL = 34  # pixels below a tile, for its title
SHEET_COLUMNS = 4  # of the contact sheet
COLOURS = 256  # of a picture in the repository: a third of the bytes of true colour


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


def write_film(entry: Entry, run: Run, out: Path) -> Path:
    """The levels beside each other, as an animated WebP, which a page shows like a picture."""
    frames = film_frames(run.info["steps"], run.dt, entry.slow)
    return render(run, out, steps=frames, size=entry.size, fps=FRAMES_PER_SECOND, **_seen(entry))


def write_picture(entry: Entry, run: Run, out: Path) -> Path:
    """Rows are levels, columns are moments."""
    return _fewer_colours(render(run, out, cell_width=260, **_seen(entry)))


def write_binding(run: Run, out: Path) -> Path:
    """How level 1 is bound to level 0; finer pairs (`pdvol info --pictures`) have more dots than a page can show."""
    from mpi4py import MPI

    from pdvol.levels.hierarchy import Hierarchy
    from pdvol.studio.draw.bindings import draw_binding

    pair = Hierarchy([level.mesh for level in run.levels], MPI.COMM_SELF, run.info["prolongation"]).prolongation(1)
    up = run.info.get("up") or (0.0, 0.0, 1.0)
    title = f"levels 0 -> 1, {run.info['prolongation']}"
    return draw_binding(out, pair.coarse.mesh, pair.fine.mesh, pair.binding.cells, pair.weights(), title, up)


def write_tile(entry: Entry, run: Run, out: Path) -> Path:
    """The finest level at the entry's moment, without captions."""
    from pdvol.studio.draw.camera_path import cameras_of_run
    from pdvol.studio.draw.cut import read_cut
    from pdvol.studio.draw.renderer import Renderer
    from pdvol.studio.draw.views import read_view

    step = min(round(entry.moment / run.dt), run.info["steps"])
    level = next(level for level in reversed(run.levels) if level.steps > step)
    aspect = TILE[0] / TILE[1]
    camera = cameras_of_run(run, [level], [step], run.obstacles, entry.turn, read_view(entry.view), False, aspect)[0]
    cut = read_cut(entry.cut, run.info["bodies"], [str(obstacle.name) for obstacle in run.obstacles])
    with Renderer(run, camera, TILE[0], run.obstacles, render_meshes=entry.drawn, cut=cut) as renderer:
        picture = renderer.picture(level, step)
    out.parent.mkdir(parents=True, exist_ok=True)
    picture.save(out)
    return _fewer_colours(out)


def write_sheet(entries: Sequence[Entry], tiles: Path, out: Path) -> Path:
    """All demos whose tile is there, titles below; nothing where there is none."""
    shown = [entry for entry in entries if (tiles / f"{entry.name}.png").is_file()]
    if not shown:
        return out
    columns = min(SHEET_COLUMNS, len(shown))
    rows = -(-len(shown) // columns)
    sheet = Image.new("RGB", (columns * TILE[0], rows * (TILE[1] + LABEL)), BACKGROUND)
    pen = ImageDraw.Draw(sheet)
    for place, entry in enumerate(shown):
        x, y = place % columns * TILE[0], place // columns * (TILE[1] + LABEL)
        with Image.open(tiles / f"{entry.name}.png") as tile:
            sheet.paste(tile.convert("RGB"), (x, y))
        pen.text((x + TILE[0] / 2, y + TILE[1] + LABEL / 2), entry.title, INK, font(16), anchor="mm")
    sheet.save(out)
    return _fewer_colours(out)


def _seen(entry: Entry) -> dict[str, Any]:
    """How `render` draws an entry."""
    return {"turn": entry.turn, "view": entry.view, "cut": entry.cut, "render_meshes": entry.drawn}


def _fewer_colours(file: Path) -> Path:
    with Image.open(file) as picture:
        colours = picture.convert("RGB")
        # Only with a palette that is there does Pillow spread what colours lack: soft shadows must not have steps.
        few = colours.quantize(palette=colours.quantize(COLOURS), dither=Image.Dither.FLOYDSTEINBERG)
    few.save(file, optimize=True)
    return file
