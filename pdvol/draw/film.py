"""Films of a run: all levels side by side, at the speed of the simulated motion. MP4 and GIF need imageio (pip install
'pdvol[film]').
"""

import importlib.util
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pdvol.draw.camera import camera_of_run
from pdvol.draw.layout import BACKGROUND, CELL_GAP, FAINT_INK, INK, font
from pdvol.draw.renderer import Renderer
from pdvol.errors import InputError, SimulationError
from pdvol.store.files import TEMPORARY
from pdvol.store.obstacles import DrawnObstacle
from pdvol.store.reader import Run, RunLevel

MOST_FRAMES_PER_SECOND = 30.0  # where time steps are shorter, some are left out
_HEADER = 64  # pixels above the pictures, for captions


def write_film(
    run: Run,
    path: Path,
    levels: Sequence[RunLevel],
    steps: Sequence[int] | None,
    obstacles: Sequence[DrawnObstacle],
    cell_width: int,
    turn: float = 0.0,
) -> Path:
    """Write a .gif or .mp4; see `pdvol.draw.picture.render` for the arguments and `FilmFile` for the errors. Frames are
    drawn and encoded one at a time.
    """
    stride = max(1, round(1.0 / (MOST_FRAMES_PER_SECOND * run.dt)))
    frames = list(range(0, max(level.steps for level in levels), stride)) if steps is None else list(steps)
    camera = camera_of_run(run, levels, frames, obstacles, turn)
    with (
        FilmFile(path, 1.0 / (stride * run.dt)) as film,
        Renderer(run, camera, cell_width, obstacles, oversampling=2) as renderer,
    ):
        for step in frames:
            film.add(_frame(renderer, levels, step, run.dt))
    return path


class FilmFile:
    """A .gif or .mp4 that is written a frame at a time, in a `with` block: it has its name once it is whole.

    Parameters
    ----------
    path : the file
    rate : frames per second

    Raises
    ------
    InputError
        The ending is another one, or imageio, or for .mp4 its ffmpeg, is not installed.
    SimulationError
        The disk cannot be written.
    """

    def __init__(self, path: Path, rate: float):
        is_mp4 = path.suffix.lower() == ".mp4"
        if not is_mp4 and path.suffix.lower() != ".gif":
            raise InputError(f"{path}: the name of a film ends in .gif or .mp4")
        for module in ("imageio", "imageio_ffmpeg") if is_mp4 else ("imageio",):
            if importlib.util.find_spec(module) is None:
                raise InputError(f"{path}: a film needs {module}: pip install 'pdvol[film]'")
        # The encoder chooses the format by the file name's ending, so the temporary name keeps it.
        self._path, self._aside = path, path.with_name(f".{path.stem}{TEMPORARY}{path.suffix}")
        mp4 = {"fps": rate, "codec": "libx264", "quality": 8, "macro_block_size": 2, "ffmpeg_log_level": "error"}
        self._options = mp4 if is_mp4 else {"duration": 1000 / rate, "loop": 0}

    def add(self, frame: Image.Image) -> None:
        """Append a picture; all have one size, of even sides."""
        self._film.append_data(np.asarray(frame))

    def __enter__(self) -> "FilmFile":
        import imageio.v2 as imageio

        try:
            self._film = imageio.get_writer(self._aside, **self._options)
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


def _frame(renderer: Renderer, levels: Sequence[RunLevel], step: int, dt: float) -> Image.Image:
    """All levels at one step. A level that is not simulated that far keeps its last state, with its time in grey."""
    width, height = renderer.size
    across, down = len(levels) * (width + CELL_GAP) - CELL_GAP, _HEADER + height
    frame = Image.new("RGB", (across + across % 2, down + down % 2), BACKGROUND)  # encoders need even numbers
    pen = ImageDraw.Draw(frame)
    for i, level in enumerate(levels):
        x, held = i * (width + CELL_GAP), min(step, level.steps - 1)
        frame.paste(renderer.picture(level, held), (x, _HEADER))
        pen.text((x + 16, 22), f"level {level.index}", INK, font(19), anchor="lm")
        pen.text((x + 16, 46), f"{len(level.rest):,} vertices", FAINT_INK, font(14), anchor="lm")
        pen.text((x + width - 16, 22), f"{held * dt:.2f} s", INK if held == step else FAINT_INK, font(17), anchor="rm")
    return frame
