"""A picture of a run: rows are levels, columns moments, all by one camera. Films show all levels side by side."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from pdvol.errors import InputError
from pdvol.stages import say, stage
from pdvol.store.files import require_place
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera import cameras_of_run
from pdvol.studio.draw.compose import Grid, Pane, Pen, composed
from pdvol.studio.draw.film import FILM_ENDINGS, film_rate, film_steps, write_film
from pdvol.studio.draw.layout import CELL_GAP, FAINT_INK, INK, write_png
from pdvol.studio.draw.views import STANDARD_SHOT, Shot, read_view

HIGHEST_RATE = 240.0  # frames a second: no screen shows more
SMALLEST_SIDE, LARGEST_SIDE = 64, 8192  # pixels: captions must fit, and what is rendered in one piece
CAPTIONS = (132, 42, CELL_GAP, CELL_GAP)  # pixels about the moments: captions are on the left and above
COLUMNS = 5  # moments of a picture, where they are not chosen by step
SAMPLED_STATES = 60  # states at which a run's motion is measured to choose moments: enough for five of them
LANDSCAPE = (960, 540)  # pixels: size of a film of a single level
FILM_HEADER = 64  # pixels above the pictures of a film, for captions


def render(
    run: Run,
    path: str | Path,
    levels: Sequence[int] | None = None,
    steps: Sequence[int] | None = None,
    shot: Shot = STANDARD_SHOT,
) -> Path:
    """Draw a run off screen.

    Parameters
    ----------
    run : finished or not
    path : .png, or .gif, .mp4 or .webp for a film
    levels : rows of the picture; all levels with a stored state when None
    steps : columns of the picture, or frames of the film; chosen over time and motion when None

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
    ending, endings = path.suffix.lower(), ", ".join(FILM_ENDINGS)
    if ending not in (".png", *FILM_ENDINGS):
        raise InputError(f"{path}: the name of a picture ends in .png, {endings}")
    if shot.size is not None:
        (width, height), name = shot.size, f"size = {shot.size[0]}x{shot.size[1]}"
        if not all(SMALLEST_SIDE <= side <= LARGEST_SIDE for side in shot.size):
            raise InputError(f"{name}: each side has {SMALLEST_SIDE} to {LARGEST_SIDE} pixels")
        if ending != ".png" and (width % 2 or height % 2):
            raise InputError(f"{name}: films need even numbers; take {width // 2 * 2}x{height // 2 * 2}")
    if shot.fps is not None and not (ending != ".png" and 0.0 < shot.fps <= HIGHEST_RATE):
        raise InputError(f"fps = {shot.fps:g}: a {endings} has more than 0 and up to {HIGHEST_RATE:g} frames a second")
    shown = _levels(run, levels)
    first, last = _span(run, shown, steps, shot)
    rate = film_rate(run.dt, shot.fps, gif=ending == ".gif")
    if steps is None and ending == ".png":
        steps = chosen_steps(shown[0], last, COLUMNS, first)
    elif steps is None:
        steps = film_steps(first, last, run.dt, rate)
    require_place(path.parent)
    with stage(f"drawing {path.name}"):
        if ending == ".png":
            return write_png(path, still(run, shown, steps, shot))
        frames = film_frames(run, shown, steps, shot)
        path.parent.mkdir(parents=True, exist_ok=True)
        return write_film(path, _counted(frames, len(steps)), rate)


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
    shown, shot = _levels(run, levels), Shot(camera, turn, width=width)
    first, last = _span(run, shown, steps, shot)
    return still(run, shown, chosen_steps(shown[0], last) if steps is None else steps, shot)


def still(run: Run, levels: Sequence[RunLevel], steps: Sequence[int], shot: Shot) -> Image.Image:
    """A picture with a row for each level and a column for each step.

    Raises
    ------
    InputError
        The shot does not fit the run.
    """
    rows, columns = len(levels), len(steps)
    grid = Grid(rows * columns, columns, margin=CAPTIONS)
    if shot.size is not None:
        grid = grid.filling(shot.size)

    def pane(level: RunLevel, column: int) -> Pane:
        def words(pen: Pen, step: int) -> None:
            width, height = pen.size
            if step >= level.steps:
                pen.text(width / 2, height / 2, "not simulated yet", 15, FAINT_INK, "mm")
            if level is levels[0]:
                pen.text(width / 2, 2 - CAPTIONS[1] / 2, f"{step * run.dt:.3g} s", 19, anchor="mm")
            if column == 0:
                pen.text(20 - CAPTIONS[0], height / 2 - 13, f"level {level.index}", 21)
                pen.text(20 - CAPTIONS[0], height / 2 + 13, f"{len(level.rest):,} vertices", 14, FAINT_INK)

        return Pane(run, level if steps[column] < level.steps else None, words)

    panes = [pane(level, column) for level in levels for column in range(columns)]
    return next(composed(panes, steps, shot, grid, [list(range(columns)) * rows]))


def film_frames(run: Run, levels: Sequence[RunLevel], steps: Sequence[int], shot: Shot) -> Iterator[Image.Image]:
    """The frames of a film, one for each step: all levels beside each other. A level that is not simulated that far
    keeps its last state, with its time in grey.

    Raises
    ------
    InputError
        The shot does not fit the run.
    """

    grid = Grid(len(levels), len(levels), above=FILM_HEADER)
    size = shot.size or (LANDSCAPE if shot.width is None and len(levels) == 1 else None)
    if size is not None:
        grid = grid.filling(size, cameras_of_run(run, levels, steps, read_view(shot.view, shot.turn))[0].aspect)
    panes = [film_pane(run, level, f"level {level.index}", f"{len(level.rest):,} vertices") for level in levels]
    return composed(panes, steps, shot, grid)


def film_pane(run: Run, level: RunLevel, title: str, note: str, colours: np.ndarray | None = None) -> Pane:
    """A place in a film, with a title, a note and the time above it; of its colours, see `Pane`."""

    def words(pen: Pen, step: int) -> None:
        held = min(step, level.steps - 1)
        pen.text(16, 22 - FILM_HEADER, title, 19)
        pen.text(16, 46 - FILM_HEADER, note, 14, FAINT_INK)
        ink = INK if held == step else FAINT_INK
        pen.text(pen.size[0] - 16, 22 - FILM_HEADER, f"{held * run.dt:.2f} s", 17, ink, "rm")

    return Pane(run, level, words, colours)


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


def _counted(frames: Iterator[Image.Image], count: int) -> Iterator[Image.Image]:
    """The frames, each of which the stage names."""
    for number, frame in enumerate(frames, 1):
        say(f"frame {number} of {count}")
        yield frame
    say(f"{count} frames")


def _levels(run: Run, wanted: Sequence[int] | None) -> list[RunLevel]:
    if wanted is None:
        wanted = [level.index for level in run.levels if level.steps]
        if not wanted:
            raise InputError(f"{run.path} has no stored state to draw")
    for index in wanted:
        if not 0 <= index < len(run.levels) or run.levels[index].steps == 0:
            raise InputError(f"{run.path} has no stored state of level {index}")
    if len(wanted) == 0:
        raise InputError("name at least one level to draw")
    return [run.levels[index] for index in wanted]


def _span(run: Run, levels: Sequence[RunLevel], steps: Sequence[int] | None, shot: Shot) -> tuple[int, int]:
    """The first and the last step of which moments are chosen, where all that are asked for are stored."""
    stored = max(level.steps for level in levels) - 1
    if steps is not None and (len(steps) == 0 or min(steps) < 0 or max(steps) > stored):
        raise InputError(f"{run.path}: steps to draw must lie between 0 and {stored}, not {list(steps)}")
    first, last = shot.span
    last = stored if last is None else last
    if not 0 <= first <= last <= stored:
        raise InputError(f"{run.path}: steps {first}:{last} are not stored; there are steps 0:{stored}")
    return first, last
