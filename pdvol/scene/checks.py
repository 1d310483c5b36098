"""What the scene's dataclasses ask of the values they are given: each check raises one line that names the value."""

import sys

import numpy as np

from pdvol.errors import InputError

HUGE = sys.float_info.max  # whole numbers can be larger


def require(condition: bool, message: str) -> None:
    """Refuse with `message` unless `condition` holds."""
    if not condition:
        raise InputError(message)


def finite(name: str, value, lowest=-np.inf) -> None:
    """A finite number, not below `lowest`."""
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    require(number and abs(value) <= HUGE, f"{name} = {value!r} is not a finite number")
    require(value >= lowest, f"{name} = {value!r} is below {lowest:g}")


def positive(name: str, value) -> None:
    """A finite number above zero."""
    finite(name, value)
    require(value > 0, f"{name} = {value!r} must be positive")


def vector(name: str, value) -> None:
    """Two or three finite components."""
    require(np.ndim(value) == 1 and len(value) in (2, 3), f"{name} = {value!r} must have two or three components")
    for component in value:
        finite(name, component)


def sequence(name: str, value) -> None:
    """A tuple or a list."""
    require(
        isinstance(value, (tuple, list)), f"{name} must be a tuple, as in {name}=(..., ), not {type(value).__name__}"
    )


def count(name: str, value, lowest: int) -> None:
    """A whole number, not below `lowest`."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    require(whole and value >= lowest, f"{name} = {value!r} is not a whole number >= {lowest}")


def called(name: str, function, arguments: tuple, shape: tuple[int, ...]) -> np.ndarray:
    """What a user's function gives, which must be an array of this shape."""
    try:
        result = np.asarray(function(*arguments))
    except Exception as error:
        raise InputError(f"{name} failed: {type(error).__name__}: {' '.join(str(error).split())}") from error
    require(result.shape == shape, f"{name} must give an array of shape {shape}, not {result.shape}")
    return result
