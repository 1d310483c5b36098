"""The colours of bodies, obstacles and ground, which pictures and exports share."""

GROUND = "#e6e1d8"  # half-spaces
OBSTACLE = "#c9ccd2"  # rigid obstacles
PALETTE = ("#f08a67", "#56a3b5", "#f0bd4f", "#8f80c4", "#7fb685", "#e48fb0", "#6b8fc7", "#b98b6a")  # bodies, levels


def linear_colour(code: str) -> tuple[float, float, float]:
    """Red, green and blue in linear light, 0 to 1, of an sRGB colour such as "#f08a67" (IEC 61966-2-1)."""
    red, green, blue = (_linear(int(code[i : i + 2], 16) / 255) for i in (1, 3, 5))
    return red, green, blue


def srgb_colour(code: str) -> tuple[float, float, float]:
    """Red, green and blue as sRGB stores them, 0 to 1."""
    red, green, blue = (int(code[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return red, green, blue


def _linear(value: float) -> float:
    return value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4
