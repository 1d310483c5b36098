"""A picture of a run: rows are levels, columns are moments, all with the same camera. Film files show all levels side
by side.
"""

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pdvol.draw.camera import camera_of_run
from pdvol.draw.film import write_film
from pdvol.draw.layout import BACKGROUND, CELL_GAP, FAINT_INK, INK, font
from pdvol.draw.renderer import Renderer
from pdvol.errors import InputError
from pdvol.store.files import write_bytes
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel

COLUMNS = 5  # moments of a picture, where they are not asked for by step
SAMPLED_STATES = 60  # states at which a run's motion is measured to choose moments: enough for five of them


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
        Angle of the camera about a 3D scene, from the front to its right.

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
        return write_film(run, path, shown, steps, drawn, cell_width, turn)
    moments = chosen_steps(shown[0], last) if steps is None else list(steps)
    camera = camera_of_run(run, shown, moments, drawn, turn)
    with Renderer(run, camera, cell_width, drawn) as renderer:
        cells = [[renderer.picture(level, step) for step in moments] for level in shown]
    sheet = _sheet(cells, [f"{step * run.dt:.3g} s" for step in moments], shown)
    buffer = io.BytesIO()
    sheet.save(buffer, "PNG", optimize=True)
    write_bytes(path, buffer.getvalue())
    return path


def chosen_steps(level: RunLevel, last: int, count: int = COLUMNS) -> list[int]:
    """Steps that show the course of a run: the first and the last, and between them equal shares of the sum of time and
    the bodies' motion.

    Parameters
    ----------
    level : the motion is that of this level
    last : the last step of all levels drawn; it is added where this level is not simulated as far
    count : steps of this level
    """
    stored = level.steps - 1
    sampled = np.unique(np.linspace(0, stored, min(stored, SAMPLED_STATES) + 1).round().astype(int))
    states = [level.positions(int(step)) for step in sampled]
    motion = np.array(
        [0.0] + [np.linalg.norm(b - a, axis=1).mean() for a, b in zip(states, states[1:], strict=False)]
    ).cumsum()
    share = sampled / max(stored, 1) + (motion / motion[-1] if motion[-1] > 0 else 0)
    steps = np.interp(np.linspace(0, share[-1], count), share, sampled).round().astype(int)
    return sorted({int(step) for step in steps} | ({last} if last > stored else set()))


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
    sheet = Image.new(
        "RGB", (left + len(times) * (width + CELL_GAP), top + len(levels) * (height + CELL_GAP)), BACKGROUND
    )
    pen = ImageDraw.Draw(sheet)
    for j, time in enumerate(times):
        pen.text((left + j * (width + CELL_GAP) + width / 2, top / 2 + 2), time, INK, font(19), anchor="mm")
    for i, (row, level) in enumerate(zip(cells, levels, strict=True)):
        y = top + i * (height + CELL_GAP)
        pen.text((20, y + height / 2 - 13), f"level {level.index}", INK, font(21), anchor="lm")
        pen.text((20, y + height / 2 + 13), f"{len(level.rest):,} vertices", FAINT_INK, font(14), anchor="lm")
        for j, image in enumerate(row):
            sheet.paste(image, (left + j * (width + CELL_GAP), y))
    return sheet
