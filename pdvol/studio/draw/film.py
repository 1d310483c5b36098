"""Films of a run: all levels beside each other, at the speed of the simulated motion. They need imageio (pip install
'pdvol[film]').
"""

import importlib.util
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw

from pdvol.errors import InputError, SimulationError
from pdvol.stages import say
from pdvol.store.files import TEMPORARY
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel
from pdvol.studio.draw.camera import Camera, camera_of_run
from pdvol.studio.draw.camera_path import cameras_of_run
from pdvol.studio.draw.layout import BACKGROUND, CELL_GAP, FAINT_INK, INK, font, grid
from pdvol.studio.draw.renderer import Renderer
from pdvol.studio.draw.views import STANDARD_VIEW, View

FILM_ENDINGS = (".gif", ".mp4", ".webp")  # of the files of films; all but GIF are written by ffmpeg
MOST_FRAMES_PER_SECOND = 30.0  # where time steps are shorter and no rate is given, some are left out
LANDSCAPE = (960, 540)  # pixels: size of a film of a single level
QUALITY = 88  # of 100, of WebP: at 75, faint edges of earlier frames remain beside what moves
_HEADER = 64  # pixels above the pictures, for captions
_SHARPEST = 4096  # pixels, a side of a film: up to it four pixels are rendered for each one


def write_film(
    run: Run,
    path: Path,
    levels: Sequence[RunLevel],
    steps: Sequence[int] | None,
    obstacles: Sequence[DrawnObstacle],
    cell_width: int | None = 420,
    turn: float = 0.0,
    *,
    size: tuple[int, int] | None = None,
    fps: float | None = None,
    span: tuple[int, int] | None = None,
    view: View = STANDARD_VIEW,
    render_meshes: bool = False,
) -> Path:
    """Write a film; see `pdvol.studio.draw.picture.render` for the arguments and `FilmFile` for more errors. Frames
    are drawn and encoded one at a time.

    Parameters
    ----------
    steps : the frames; those of `film_steps` when None
    cell_width : of a level [pixels]; when None, a single level is drawn in `LANDSCAPE` and several in 420 pixels each
    span : first and last step; all when None

    Raises
    ------
    InputError
        The size is too small for its levels.
    """
    rate = film_rate(run.dt, fps, gif=path.suffix.lower() == ".gif")
    first, last = (0, max(level.steps for level in levels) - 1) if span is None else span
    frames = film_steps(first, last, run.dt, rate) if steps is None else list(steps)
    if size is None and cell_width is None and len(levels) == 1:
        size = LANDSCAPE
    columns, width, aspect = len(levels), cell_width or 420, None
    if size is not None:
        content = camera_of_run(run, levels, frames, obstacles, turn).aspect
        columns, (width, height) = grid(len(levels), size, content, _HEADER)
        if min(width, height) < 32:
            raise InputError(f"{size[0]}x{size[1]} pixels are too small for {len(levels)} levels; choose a larger size")
        aspect = width / height
    cameras = cameras_of_run(run, levels, frames, obstacles, turn, view, aspect)
    oversampling = 2 if size is None or max(size) <= _SHARPEST else 1
    drawing = Renderer(run, cameras[0], width, obstacles, oversampling, render_meshes, view.cut)
    with FilmFile(path, rate) as film, drawing as renderer:
        for number, (step, camera) in enumerate(zip(frames, cameras, strict=True), 1):
            say(f"frame {number} of {len(frames)}")
            film.add(_frame(renderer, levels, step, run.dt, camera, columns, size))
    say(f"{len(frames)} frames")
    return path


class FilmFile:
    """A .gif, .mp4 or .webp that is written a frame at a time, in a `with` block: it has its name once it is whole.

    Parameters
    ----------
    path : the file
    rate : frames per second

    Raises
    ------
    InputError
        The ending is another one, or imageio, or its ffmpeg for .mp4 and .webp, is not installed.
    SimulationError
        The disk cannot be written.
    """

    def __init__(self, path: Path, rate: float):
        ending = path.suffix.lower()
        if ending not in FILM_ENDINGS:
            raise InputError(f"{path}: the name of a film ends in {', '.join(FILM_ENDINGS)}")
        for module in ("imageio",) if ending == ".gif" else ("imageio", "imageio_ffmpeg"):
            if importlib.util.find_spec(module) is None:
                raise InputError(f"{path}: a film needs {module}: pip install 'pdvol[film]'")
        # imageio chooses the encoder by the temporary name, and knows ffmpeg for .mp4 alone: words give the format.
        aside = ".gif" if ending == ".gif" else ".mp4"
        self._path, self._aside = path, path.with_name(f".{path.stem}{TEMPORARY}{aside}")
        ffmpeg: dict[str, Any] = {"fps": rate, "macro_block_size": 2, "ffmpeg_log_level": "error"}
        webp = ["-f", "webp", "-quality", str(QUALITY), "-loop", "0"]
        self._options: dict[str, Any] = {
            ".gif": {"duration": 1000 / rate, "loop": 0},
            ".mp4": {**ffmpeg, "codec": "libx264", "quality": 8},
            ".webp": {**ffmpeg, "codec": "libwebp_anim", "quality": None, "output_params": webp},
        }[ending]

    def add(self, frame: Image.Image) -> None:
        """Append a picture; all have one size, of even sides."""
        self._film.append_data(np.asarray(frame))

    def __enter__(self) -> "FilmFile":
        import imageio.v2 as imageio

        try:
            self._film: Any = imageio.get_writer(self._aside, **self._options)
        except OSError as error:
            raise self._unwritable(error) from error
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        try:
            self._film.close()
            if kind is None:
                os.replace(self._aside, self._path)
        except OSError as closing:
            raise self._unwritable(closing) from closing
        finally:
            self._aside.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> SimulationError:
        return SimulationError(f"cannot write {self._path}: {error.strerror or error}")


def film_rate(dt: float, fps: float | None = None, gif: bool = False) -> float:
    """Frames a second of a film at real speed.

    Parameters
    ----------
    dt : time step [s]
    fps : wanted; when None, that of every k-th state, with the smallest k for `MOST_FRAMES_PER_SECOND` or about so many
    gif : a frame of these lasts for whole hundredths of a second, two at least: the nearest such rate is given
    """
    rate = 1.0 / (max(1, round(1.0 / (MOST_FRAMES_PER_SECOND * dt))) * dt) if fps is None else fps
    return 100.0 / max(2, round(100.0 / rate)) if gif else rate


def film_steps(first: int, last: int, dt: float, rate: float) -> list[int]:
    """The steps that a film at real speed shows, from `first` to `last`: at each frame's time the nearest stored one.

    Parameters
    ----------
    dt : time step [s]
    rate : frames a second
    """
    count = int(np.floor((last - first) * dt * rate + 1e-6)) + 1
    times = np.arange(count) / rate
    return [min(first + int(np.floor(time / dt + 0.5 + 1e-9)), last) for time in times]


def _frame(
    renderer: Renderer,
    levels: Sequence[RunLevel],
    step: int,
    dt: float,
    camera: Camera,
    columns: int,
    size: tuple[int, int] | None,
) -> Image.Image:
    """All levels at one step. A level that is not simulated that far keeps its last state, with its time in grey."""
    width, height = renderer.size
    rows = -(-len(levels) // columns)
    across, down = columns * (width + CELL_GAP) - CELL_GAP, rows * (_HEADER + height + CELL_GAP) - CELL_GAP
    # Encoders need even numbers.
    frame = Image.new("RGB", (across + across % 2, down + down % 2) if size is None else size, BACKGROUND)
    pen = ImageDraw.Draw(frame)
    left, top = (max(0, (whole - used) // 2) for whole, used in zip(frame.size, (across, down), strict=True))
    for i, level in enumerate(levels):
        held = min(step, level.steps - 1)
        x, y = left + (i % columns) * (width + CELL_GAP), top + (i // columns) * (_HEADER + height + CELL_GAP)
        frame.paste(renderer.picture(level, held, camera), (x, y + _HEADER))
        pen.text((x + 16, y + 22), f"level {level.index}", INK, font(19), anchor="lm")
        pen.text((x + 16, y + 46), f"{len(level.rest):,} vertices", FAINT_INK, font(14), anchor="lm")
        ink = INK if held == step else FAINT_INK
        pen.text((x + width - 16, y + 22), f"{held * dt:.2f} s", ink, font(17), anchor="rm")
    return frame
