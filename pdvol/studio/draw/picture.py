"""A picture of a run: rows are levels, columns are moments, all with the same camera. Film files show all levels side
by side.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pdvol.errors import InputError
from pdvol.stages import stage
from pdvol.store.files import require_place
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera_path import cameras_of_run
from pdvol.studio.draw.cut import read_cut
from pdvol.studio.draw.film import FILM_ENDINGS, write_film
from pdvol.studio.draw.layout import BACKGROUND, CELL_GAP, FAINT_INK, INK, font, write_png
from pdvol.studio.draw.renderer import Renderer
from pdvol.studio.draw.views import read_view

HIGHEST_RATE = 240.0  # frames a second: no screen shows more
SMALLEST_SIDE, LARGEST_SIDE = 64, 8192  # pixels: captions must fit, and what is rendered in one piece
_LEFT, _TOP = 132, 42  # pixels beside and above the moments, for captions
COLUMNS = 5  # moments of a picture, where they are not chosen by step
SAMPLED_STATES = 60  # states at which a run's motion is measured to choose moments: enough for five of them


def render(
    run: Run,
    path: str | Path,
    levels: Sequence[int] | None = None,
    steps: Sequence[int] | None = None,
    obstacles: Sequence[DrawnObstacle] | None = None,
    cell_width: int | None = None,
    turn: float = 0.0,
    *,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    span: tuple[int, int | None] | None = None,
    view: str = "",
    render_meshes: bool = False,
    cut: str = "",
) -> Path:
    """Draw a run off screen.

    Parameters
    ----------
    run : Run
        Finished or not.
    path : .png, or .gif, .mp4 or .webp for a film
    levels : rows of the picture; all levels with a stored state when None
    steps : columns of the picture, or frames of the film; chosen over time and motion when None
    obstacles : those stored in the run when None
    cell_width : int [pixels]
        Width of one moment; 420 when None, and films of a single level are then 960 x 540.
    turn : float [degrees]
        Angle of the camera about a 3D scene, from the front to its right.
    size : width and height of the whole file [pixels], instead of `cell_width`
    fps : frames a second of a film; it plays at real speed, each frame shows the nearest stored state
    span : first and last step, both included, from which moments or frames are chosen; the last stored one when None
    view : "front", "side", "top", "three-quarter", "follow:BODY", or "X,Y,Z:TX,TY,TZ" [m]
    render_meshes : bodies that carry render meshes are drawn as these
    cut : "z=0.1" takes away what bodies of a 3D scene have before the plane z = 0.1 m, seen from the camera;
        "z=0.1:NAME,..." cuts these bodies and obstacles alone

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        When nothing is stored, a level, step, view or body does not exist, a size does not fit, the ending is unknown,
        or a film's extra is not installed.
    """
    path = Path(path)
    drawn = run.obstacles if obstacles is None else tuple(obstacles)
    names = [str(obstacle.name) for obstacle in drawn]
    seen = replace(read_view(view), cut=read_cut(cut, [str(name) for name in run.info.get("bodies", [])], names))
    if path.suffix.lower() not in (".png", *FILM_ENDINGS):
        raise InputError(f"{path}: the name of a picture ends in {', '.join(('.png', *FILM_ENDINGS))}")
    if seen.cut is not None and run.levels[0].rest.shape[1] == 2:
        raise InputError(f"--cut: {run.path} is 2D, and nothing hides anything there")
    is_film = path.suffix.lower() != ".png"
    _check_size(size, is_film)
    if fps is not None and not (is_film and 0.0 < fps <= HIGHEST_RATE):
        endings = ", ".join(FILM_ENDINGS)
        raise InputError(f"fps = {fps:g}: a {endings} has more than 0 and up to {HIGHEST_RATE:g} frames a second")
    shown = _levels(run, levels)
    last = max(level.steps for level in shown) - 1
    if steps is not None and (len(steps) == 0 or min(steps) < 0 or max(steps) > last):
        raise InputError(f"{run.path}: steps to draw must lie between 0 and {last}, not {list(steps)}")
    begin, end = _checked_span(run, span, last)
    require_place(path.parent)
    path.parent.mkdir(parents=True, exist_ok=True)
    if is_film:
        with stage(f"drawing {path.name}"):
            return write_film(
                run,
                path,
                shown,
                steps,
                drawn,
                cell_width,
                turn,
                size=size,
                fps=fps,
                span=(begin, end),
                view=seen,
                render_meshes=render_meshes,
            )
    moments = chosen_steps(shown[0], end, COLUMNS, begin) if steps is None else list(steps)
    width, aspect = cell_width or 420, None
    if size is not None:
        width, height = _cell_size(size, len(moments), len(shown))
        aspect = width / height
    with stage(f"drawing {path.name}"):
        cameras = cameras_of_run(run, shown, moments, drawn, turn, seen, aspect)
        with Renderer(run, cameras[0], width, drawn, render_meshes=render_meshes, cut=seen.cut) as renderer:
            cells = [
                [renderer.picture(level, step, camera) for step, camera in zip(moments, cameras, strict=True)]
                for level in shown
            ]
    sheet = _sheet(cells, [f"{step * run.dt:.3g} s" for step in moments], shown, size)
    return write_png(path, sheet)


def picture(
    run: Run,
    levels: Sequence[int] | None = None,
    steps: Sequence[int] | None = None,
    width: int = 420,
    turn: float = 0.0,
    camera: str = "",
) -> Image.Image:
    """Draw a run off screen, in memory: rows are levels, columns are moments. A notebook's cell that ends with it
    shows it.

    Parameters
    ----------
    run : Run
    levels : rows; all levels with a stored state when None
    steps : columns; chosen over time and motion when None
    width : int [pixels]
        Of one moment.
    turn : float [degrees]
        Angle of the camera about a 3D scene, from the front to its right.
    camera : "front", "side", "top", "three-quarter", "follow:BODY", or position and target, "X,Y,Z:TX,TY,TZ" [m]

    Returns
    -------
    PIL.Image.Image
        Notebooks show it; `numpy.asarray` gives its pixels (height, width, 3) uint8, `save` writes a file.

    Raises
    ------
    InputError
        Nothing is stored, or a level, step, view or body does not exist.
    """
    with tempfile.TemporaryDirectory(prefix="pdvol_") as folder:
        path = Path(folder) / "run.png"
        file = render(run, path, levels=levels, steps=steps, cell_width=width, turn=turn, view=camera)
        with Image.open(file) as drawn:
            return drawn.convert("RGB")


def _check_size(size: tuple[int, int] | None, is_film: bool) -> None:
    if size is None:
        return
    name = f"size = {size[0]}x{size[1]}"
    if not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in size):
        raise InputError(f"{name}: each side has {SMALLEST_SIDE} to {LARGEST_SIDE} pixels")
    if is_film and any(side % 2 for side in size):
        raise InputError(f"{name}: films need even numbers; take {size[0] // 2 * 2}x{size[1] // 2 * 2}")


def _checked_span(run: Run, span: tuple[int, int | None] | None, last: int) -> tuple[int, int]:
    begin, end = (0, None) if span is None else span
    end = last if end is None else end
    if not 0 <= begin <= end <= last:
        raise InputError(f"{run.path}: steps {begin}:{end} are not stored; there are steps 0:{last}")
    return begin, end


def _cell_size(size: tuple[int, int], columns: int, rows: int) -> tuple[int, int]:
    """Width and height of a moment in a picture of a given size [pixels]."""
    width, height = (size[0] - _LEFT) // columns - CELL_GAP, (size[1] - _TOP) // rows - CELL_GAP
    if min(width, height) < 32:
        raise InputError(
            f"{size[0]}x{size[1]} pixels are too small for {rows} levels at {columns} moments; choose a larger size"
        )
    return width, height


def chosen_steps(level: RunLevel, last: int, count: int = COLUMNS, first: int = 0) -> list[int]:
    """Steps that show the course of a run: the first and the last, and between them equal fractions of the sum of time
    and the bodies' motion.

    Parameters
    ----------
    level : the motion is that of this level
    last : the last step of all levels drawn; it is added where this level is not simulated as far
    count : steps of this level
    first : the first step
    """
    stored = min(level.steps - 1, last)
    if first >= stored:
        return sorted({first, last})
    length = stored - first
    sampled = np.unique(np.linspace(first, stored, min(length, SAMPLED_STATES) + 1).round().astype(int))
    states = [level.positions(int(step)) for step in sampled]
    motion = np.array(
        [0.0] + [np.linalg.norm(b - a, axis=1).mean() for a, b in zip(states, states[1:], strict=False)]
    ).cumsum()
    fraction = (sampled - first) / length + (motion / motion[-1] if motion[-1] > 0 else 0)
    steps = np.interp(np.linspace(0, fraction[-1], count), fraction, sampled).round().astype(int)
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


def _sheet(
    cells: list[list[Image.Image]], times: list[str], levels: Sequence[RunLevel], size: tuple[int, int] | None
) -> Image.Image:
    """The cells with the levels' names on the left and the times above; as large as they are where `size` is None."""
    width, height = cells[0][0].size
    left, top = _LEFT, _TOP
    own = (left + len(times) * (width + CELL_GAP), top + len(levels) * (height + CELL_GAP))
    sheet = Image.new("RGB", own if size is None else size, BACKGROUND)
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
