"""Animated WebP, written a frame at a time by imageio's ffmpeg. Pages show it like a picture; a GIF is far larger."""

from collections.abc import Generator
from pathlib import Path
from typing import Any

import numpy as np

QUALITY = 88  # of 100: at 75, faint edges of earlier frames remain beside what moves


class WebpWriter:
    """Has the two methods of imageio's writers that films use.

    Parameters
    ----------
    path : the file
    rate : frames per second
    """

    def __init__(self, path: Path, rate: float):
        self._path, self._rate = path, rate
        self._pipe: Generator[None, Any, None] | None = None

    def append_data(self, frame: np.ndarray) -> None:
        """Append a picture (height, width, 3) uint8; all have the first one's size, of even sides."""
        if self._pipe is None:
            self._pipe = self._opened(frame.shape[1], frame.shape[0])
        self._pipe.send(np.ascontiguousarray(frame))

    def close(self) -> None:
        """Write what is left."""
        if self._pipe is not None:
            self._pipe.close()

    def _opened(self, width: int, height: int) -> Generator[None, Any, None]:
        import imageio_ffmpeg

        pipe = imageio_ffmpeg.write_frames(
            str(self._path),
            (width, height),
            fps=self._rate,
            codec="libwebp_anim",
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
            output_params=["-quality", str(QUALITY), "-loop", "0"],
        )
        pipe.send(None)
        return pipe
