"""Background, ink, fonts and spacing that all pictures share; the colours of what they show are in `pdvol.colours`."""

from PIL import ImageFont

BACKGROUND = "#f6f4f0"  # of every picture
INK = "#3b3f46"  # text
FAINT_INK = "#8b8f96"  # text of less importance
CELL_GAP = 8  # pixels between the pictures of two moments or levels


def font(size: float) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own typeface in a size [pixels]; every machine has it."""
    return ImageFont.load_default(size)
