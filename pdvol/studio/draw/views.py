"""Where a camera looks from, and its text on the command line."""

from dataclasses import dataclass

import numpy as np

from pdvol.errors import InputError
from pdvol.studio.draw.cut import Cut

FORMS = "front, side, top, three-quarter, follow:BODY or X,Y,Z:TX,TY,TZ (position and target in metres)"


@dataclass(frozen=True)
class View:
    """A direction of view, with a body to follow or a place to stand.

    Attributes
    ----------
    turn : from the front to the right, about the vertical [degrees]
    rise : above the horizontal [degrees]
    body : the name of the body that stays in the middle, none if empty
    position, target : (x, y, z) [m] of the camera and of the picture's middle; chosen from the content where None
    cut : takes away what hides the rest of a 3D scene
    """

    turn: float = 23.0
    rise: float = float(np.degrees(np.arctan2(0.34, 0.94)))
    body: str = ""
    position: tuple[float, ...] | None = None
    target: tuple[float, ...] | None = None
    cut: Cut | None = None


STANDARD_VIEW = View()
"""From the front, turned a little and from above to show depth."""
_NAMED = {"front": View(0.0, 0.0), "side": View(90.0, 0.0), "top": View(0.0, 90.0), "three-quarter": View(45.0, 30.0)}


def read_view(text: str) -> View:
    """The view that `--camera` names: one of `FORMS`; the standard one for an empty text.

    Raises
    ------
    InputError
        It is none of them.
    """
    if not text:
        return STANDARD_VIEW
    if text in _NAMED:
        return _NAMED[text]
    word, colon, rest = text.partition(":")
    if word == "follow" and rest:
        return View(body=rest)
    position, target = _place(word), _place(rest)
    if not colon or position is None or target is None:
        raise InputError(f"--camera: {text!r} is none of {FORMS}")
    if position == target:
        raise InputError(f"--camera: position and target of {text!r} are the same point; move one of them")
    return View(position=position, target=target)


def _place(text: str) -> tuple[float, ...] | None:
    """Three finite numbers with commas between them, None for any other text."""
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        return None
    return numbers if len(numbers) == 3 and np.isfinite(numbers).all() else None
