"""Files of films, and the steps that they show at the speed of the simulated motion. They need imageio (pip install
'imageio[ffmpeg]').
"""

import importlib.util
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageOps

from pdvol.errors import InputError, SimulationError
from pdvol.store.files import TEMPORARY
from pdvol.studio.draw.layout import BACKGROUND

FILM_ENDINGS = (".gif", ".mp4", ".webp")  # of the files of films; all but GIF are written by ffmpeg
MOST_FRAMES_PER_SECOND = 30.0  # where time steps are shorter and no rate is given, some are left out
QUALITY = 88  # of 100, of WebP: at 75, faint edges of earlier frames remain beside what moves


def write_film(path: Path, frames: Iterable[Image.Image], rate: float) -> Path:
    """Write a .gif, .mp4 or .webp, each frame as it comes: the file has its name once it is whole.

    Parameters
    ----------
    frames : of one size; odd sides get a row or column of background, as encoders need it
    rate : frames per second

    Raises
    ------
    InputError
        The ending is another one, or imageio, or its ffmpeg for .mp4 and .webp, is not installed.
    SimulationError
        The disk cannot be written.
    """
    ending = path.suffix.lower()
    if ending not in FILM_ENDINGS:
        raise InputError(f"{path}: the name of a film ends in {', '.join(FILM_ENDINGS)}")
    for module in ("imageio",) if ending == ".gif" else ("imageio", "imageio_ffmpeg"):
        if importlib.util.find_spec(module) is None:
            raise InputError(f"{path}: a film needs {module}: pip install 'imageio[ffmpeg]'")
    import imageio.v2 as imageio

    # imageio chooses the encoder by the temporary name, and knows ffmpeg for .mp4 alone: words give the format.
    aside = path.with_name(f".{path.stem}{TEMPORARY}{'.gif' if ending == '.gif' else '.mp4'}")
    ffmpeg: dict[str, Any] = {"fps": rate, "macro_block_size": 2, "ffmpeg_log_level": "error"}
    webp = ["-f", "webp", "-quality", str(QUALITY), "-loop", "0"]
    options: dict[str, Any] = {
        ".gif": {"duration": 1000 / rate, "loop": 0},
        ".mp4": {**ffmpeg, "codec": "libx264", "quality": 8},
        ".webp": {**ffmpeg, "codec": "libwebp_anim", "quality": None, "output_params": webp},
    }[ending]
    try:
        with imageio.get_writer(aside, **options) as film:
            for frame in frames:
                even = ImageOps.expand(frame, (0, 0, frame.width % 2, frame.height % 2), BACKGROUND)
                film.append_data(np.asarray(even))
        os.replace(aside, path)
    except OSError as error:
        raise SimulationError(f"cannot write {path}: {error.strerror or error}") from error
    finally:
        aside.unlink(missing_ok=True)
    return path


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
