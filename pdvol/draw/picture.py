"""A picture of a run: rows are levels, columns are moments, all seen by the same camera. Film files show all levels
side by side.
"""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from pdvol.draw.camera import View, lifted, view_of
from pdvol.draw.renderer import BACKGROUND, Studio
from pdvol.errors import InputError
from pdvol.store.files import write_bytes
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel

INK, FAINT = "#3b3f46", "#8b8f96"
MOMENTS = 5
GAP = 8


def render(
    run: Run,
    path: str | Path,
    levels: Sequence[int] | None = None,
    steps: Sequence[int] | None = None,
    obstacles: Sequence[DrawnObstacle] | None = None,
    cell_width: int = 420,
    turn: float = 0.0,
) -> Path:
    """Draw a run off screen.

    Parameters
    ----------
    run : Run
        Finished or not.
    path : .png, or .gif or .mp4 for a film
    levels : rows of the picture; all levels with a stored state when None
    steps : columns of the picture, or frames of the film; chosen over time and motion when None
    obstacles : those stored in the run when None
    cell_width : int [pixels]
        Width of one moment.
    turn : float [degrees]
        How far the camera walks round a 3D scene, from the front to its right.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        When nothing is stored, a level or step does not exist, the ending is unknown, or a film's extra is not
        installed.
    """
    path = Path(path)
    if path.suffix.lower() not in (".png", ".gif", ".mp4"):
        raise InputError(f"{path}: the name of a picture ends in .png, .gif or .mp4")
    shown = _levels(run, levels)
    last = max(level.steps for level in shown) - 1
    if steps is not None and (len(steps) == 0 or min(steps) < 0 or max(steps) > last):
        raise InputError(f"{run.path}: steps to draw must lie between 0 and {last}, not {list(steps)}")
    drawn = run.obstacles if obstacles is None else tuple(obstacles)
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix.lower() != ".png":
        from pdvol.draw.film import write_film  # a picture does not need what films need

        return write_film(run, path, shown, steps, drawn, cell_width, turn)
    moments = chosen_steps(shown[0], last) if steps is None else list(steps)
    with Studio(run, framing(run, shown, moments, drawn, turn), cell_width, drawn) as studio:
        cells = [[cell(studio, level, step) for step in moments] for level in shown]
    sheet = _sheet(cells, [f"{step * run.dt:.3g} s" for step in moments], shown)
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    write_bytes(path, buffer.getvalue())
    return path


def chosen_steps(level: RunLevel, last: int, count: int = MOMENTS) -> list[int]:
    """Moments that tell the story: first and last, and between them equal shares of time and of the bodies' motion
    together.
    """
    stored = level.steps - 1
    sampled = np.unique(np.linspace(0, stored, min(stored, 60) + 1).round().astype(int))
    states = [level.positions(int(step)) for step in sampled]
    motion = np.array(
        [0.0] + [np.linalg.norm(b - a, axis=1).mean() for a, b in zip(states, states[1:], strict=False)]
    ).cumsum()
    share = sampled / max(stored, 1) + (motion / motion[-1] if motion[-1] > 0 else 0)
    steps = np.interp(np.linspace(0, share[-1], count), share, sampled).round().astype(int)
    return sorted({int(step) for step in steps} | ({last} if last > stored else set()))


def framing(
    run: Run, levels: Sequence[RunLevel], steps: Sequence[int], obstacles: Sequence[DrawnObstacle], turn: float = 0.0
) -> View:
    """The view that holds all these levels at all these steps, and the obstacles that are not planes.

    Up is `run.info["up"]` where the run says so, else the first plane's normal, else z.
    """
    seen = [
        lifted(level.positions(step)[np.unique(level.surface)])
        for level in levels
        for step in steps
        if step < level.steps
    ]
    bodies = np.concatenate(seen)
    low, high = bodies.min(axis=0), bodies.max(axis=0)
    room = np.linalg.norm(high - low)
    for obstacle in obstacles:
        if obstacle.kind != "plane":
            vertices = lifted(np.concatenate([obstacle.vertices(step) for step in steps]))
            # A floor or a wall given as a mesh may be far larger than the shot.
            seen.append(np.clip(vertices, low - 0.3 * room, high + 0.3 * room))
    dim = levels[0].rest.shape[1]
    upward = run.info.get("up") or next((o.plane(0)[1] for o in obstacles if o.kind == "plane"), (0.0, 0.0, 1.0))
    return view_of(np.concatenate(seen), dim, np.asarray(upward, dtype=float), turn)


def cell(studio: Studio, level: RunLevel, step: int) -> Image.Image:
    """One moment of one level; an empty one where it is not simulated yet."""
    if step >= level.steps:
        image = Image.new("RGB", studio.size, BACKGROUND)
        text = "not simulated yet"
        ImageDraw.Draw(image).text((studio.size[0] / 2, studio.size[1] / 2), text, FAINT, font(15), anchor="mm")
        return image
    return Image.fromarray(studio.shot(level, step)).resize(studio.size, Image.Resampling.LANCZOS)


def font(size: float) -> ImageFont.FreeTypeFont:
    """Pillow's own typeface, which every machine has."""
    return ImageFont.load_default(size)


def _levels(run: Run, wanted: Sequence[int] | None) -> list[RunLevel]:
    if wanted is None:
        shown = [level for level in run.levels if level.steps]
        if not shown:
            raise InputError(f"{run.path} has no stored state to draw")
        return shown
    for index in wanted:
        if not 0 <= index < len(run.levels) or run.levels[index].steps == 0:
            raise InputError(f"{run.path} has no stored state of level {index}")
    if len(wanted) == 0:
        raise InputError("name at least one level to draw")
    return [run.levels[index] for index in wanted]


def _sheet(cells: list[list[Image.Image]], times: list[str], levels: Sequence[RunLevel]) -> Image.Image:
    """The cells with the levels' names on the left and the times above."""
    width, height = cells[0][0].size
    left, top = 118, 42
    sheet = Image.new("RGB", (left + len(times) * (width + GAP), top + len(levels) * (height + GAP)), BACKGROUND)
    pen = ImageDraw.Draw(sheet)
    for j, time in enumerate(times):
        pen.text((left + j * (width + GAP) + width / 2, top / 2 + 2), time, INK, font(19), anchor="mm")
    for i, (row, level) in enumerate(zip(cells, levels, strict=True)):
        y = top + i * (height + GAP)
        pen.text((20, y + height / 2 - 13), f"level {level.index}", INK, font(21), anchor="lm")
        pen.text((20, y + height / 2 + 13), f"{len(level.rest):,} vertices", FAINT, font(14), anchor="lm")
        for j, image in enumerate(row):
            sheet.paste(image, (left + j * (width + GAP), y))
    return sheet
