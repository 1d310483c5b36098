"""Background, ink, fonts and spacing that all pictures share, and how pictures of several levels share a given size."""

import io
from pathlib import Path

from PIL import Image, ImageFont

from pdvol.store.files import write_bytes

BACKGROUND = "#f6f4f0"  # of every picture
INK = "#3b3f46"  # text
FAINT_INK = "#8b8f96"  # text of less importance
CELL_GAP = 8  # pixels between the pictures of two moments or levels


def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own typeface in a size [pixels]; every machine has it."""
    return ImageFont.load_default(size)


def write_png(path: Path, picture: Image.Image) -> Path:
    """Write a picture, whole or not at all, into a folder that is made where there is none; gives its path.
    SimulationError: the disk cannot be written.
    """
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    path.parent.mkdir(parents=True, exist_ok=True)
    write_bytes(path, buffer.getvalue())
    return path


def cluster_name(cluster: int) -> str:
    """`group A` to `group Z`, then `group AA`."""
    letters = ""
    while cluster >= 0:
        letters, cluster = chr(ord("A") + cluster % 26) + letters, cluster // 26 - 1
    return f"group {letters}"


def grid(count: int, size: tuple[int, int], aspect: float, band: int) -> tuple[int, tuple[int, int]]:
    """The columns, and the width and height of a cell [pixels], with which cells of a given shape are largest.

    Parameters
    ----------
    count : cells
    size : width and height of the whole [pixels]
    aspect : width over height of what a cell shows
    band : height of the text above each cell [pixels]
    """
    best = (0.0, 1, (0, 0))
    for columns in range(1, count + 1):
        rows = -(-count // columns)
        width = (size[0] - CELL_GAP * (columns - 1)) // columns
        height = (size[1] - CELL_GAP * (rows - 1)) // rows - band
        best = max(best, (min(width / aspect, float(height)), columns, (width, height)), key=lambda found: found[0])
    return best[1], best[2]
