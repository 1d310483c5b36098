"""Colours, fonts and spacing that all pictures share."""

from PIL import ImageFont

BACKGROUND = "#f6f4f0"  # of every picture
GROUND = "#e6e1d8"  # half-spaces
OBSTACLE = "#c9ccd2"  # rigid obstacles
PALETTE = ("#f08a67", "#56a3b5", "#f0bd4f", "#8f80c4", "#7fb685", "#e48fb0", "#6b8fc7", "#b98b6a")  # bodies, levels
INK = "#3b3f46"  # text
FAINT_INK = "#8b8f96"  # text of less importance
CELL_GAP = 8  # pixels between the pictures of two moments or levels


def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own typeface in a size [pixels]; every machine has it."""
    return ImageFont.load_default(size)


def cluster_name(cluster: int) -> str:
    """`group A` to `group Z`, then `group AA`."""
    letters = ""
    while cluster >= 0:
        letters, cluster = chr(ord("A") + cluster % 26) + letters, cluster // 26 - 1
    return f"group {letters}"
