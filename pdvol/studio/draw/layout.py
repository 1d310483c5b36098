"""Background, ink, colours, fonts and spacing that all pictures share, and their files."""

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


def rgb(colour: str) -> tuple[int, int, int]:
    """`#f08a67` as three numbers from 0 to 255."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red, green, blue


def darker(colour: tuple[int, int, int], factor: float) -> tuple[int, int, int]:
    """The colour times a factor."""
    red, green, blue = (round(factor * channel) for channel in colour)
    return red, green, blue


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
