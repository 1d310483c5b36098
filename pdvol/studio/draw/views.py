"""How a run is seen: the direction of view, its text on the command line, and the options of pictures and films."""

from dataclasses import dataclass, replace

import numpy as np

from pdvol.errors import InputError

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
    """

    turn: float = 23.0
    rise: float = float(np.degrees(np.arctan2(0.34, 0.94)))
    body: str = ""
    position: tuple[float, ...] | None = None
    target: tuple[float, ...] | None = None


STANDARD_VIEW = View()
"""From the front, turned a little and from above to show depth."""
_NAMED = {
    "": STANDARD_VIEW,
    "front": View(0.0, 0.0),
    "side": View(90.0, 0.0),
    "top": View(0.0, 90.0),
    "three-quarter": View(45.0, 30.0),
}


@dataclass(frozen=True)
class Shot:
    """The options of a picture or film of a run.

    Attributes
    ----------
    view : one of `FORMS`; the standard view where empty
    turn : turns the camera about a 3D scene, from the front to its right [degrees]
    cut : "z=0.1" takes away what bodies of a 3D scene have before the plane z = 0.1 m, seen from the camera;
        "z=0.1:NAME,..." cuts these bodies and obstacles alone
    facets : whether bodies that carry render meshes are drawn by their cells
    width : of one moment [pixels]; 420 when None, and films of a single level are then 960 x 540
    size : width and height of the whole file [pixels], instead of `width`
    fps : frames a second of a film; it plays at real speed, each frame shows the nearest stored state
    span : first and last step, both included, from which moments or frames are chosen; the last stored one when None
    """

    view: str = ""
    turn: float = 0.0
    cut: str = ""
    facets: bool = False
    width: int | None = None
    size: tuple[int, int] | None = None
    fps: float | None = None
    span: tuple[int, int | None] = (0, None)


STANDARD_SHOT = Shot()


def read_view(text: str, turn: float = 0.0) -> View:
    """The view that `--camera` names, one of `FORMS`, turned further about the vertical [degrees]; the standard one for
    an empty text.

    Raises
    ------
    InputError
        It is none of them.
    """
    word, colon, rest = text.partition(":")
    if text in _NAMED:
        view = _NAMED[text]
    elif word == "follow" and rest:
        view = View(body=rest)
    else:
        position, target = _place(word), _place(rest)
        if not colon or position is None or target is None:
            raise InputError(f"--camera: {text!r} is none of {FORMS}")
        if position == target:
            raise InputError(f"--camera: position and target of {text!r} are the same point; move one of them")
        view = View(position=position, target=target)
    return replace(view, turn=view.turn + turn)


def _place(text: str) -> tuple[float, ...] | None:
    """Three finite numbers with commas between them, None for any other text."""
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        return None
    return numbers if len(numbers) == 3 and np.isfinite(numbers).all() else None
