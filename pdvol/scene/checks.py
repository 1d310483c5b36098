"""Checks of the values in a scene's dataclasses: each raises an error of one line that names the value."""

import inspect
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from pdvol.errors import InputError

FAR_OUTSIDE = 0.1  # of a body's diagonal: a place further outside its box is a typing error
HUGE = sys.float_info.max  # largest finite number: whole numbers can be larger


def require(condition: bool | np.bool_, message: str) -> None:
    """Refuse with `message` unless `condition` holds."""
    if not condition:
        raise InputError(message)


def plain(value: Any) -> Any:
    """Arrays, lists and tuples, also nested ones, as tuples; NumPy's numbers as Python's. Other values as they are.

    The dataclasses keep their values so: they compare and hash by value, however they were given.
    """
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (tuple, list)):
        return tuple(plain(item) for item in value)
    return value.item() if isinstance(value, np.number | np.bool_) else value


def keep_plain(element: object, *names: str) -> None:
    """Replaces these attributes of a frozen dataclass by their `plain` values; for its `__post_init__`."""
    for name in names:
        object.__setattr__(element, name, plain(getattr(element, name)))


def finite(name: str, value: Any, lowest: float = -np.inf) -> None:
    """A finite number, not below `lowest`."""
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    require(number and abs(value) <= HUGE, f"{name} = {' '.join(repr(value).split())} is not a finite number")
    require(value >= lowest, f"{name} = {value!r} is below {lowest:g}")


def positive(name: str, value: Any) -> None:
    """A finite number above zero."""
    finite(name, value)
    require(value > 0, f"{name} = {value!r} must be positive")


def vector(name: str, value: Any) -> None:
    """Two or three finite components, as `plain` leaves them."""
    flat = isinstance(value, tuple) and not any(isinstance(component, tuple) for component in value)
    require(
        flat and len(value) in (2, 3), f"{name} = {' '.join(repr(value).split())} must have two or three components"
    )
    for component in value:
        finite(name, component)


def sequence(name: str, value: Any) -> None:
    """A tuple or a list."""
    require(
        isinstance(value, (tuple, list)), f"{name} must be a tuple, as in {name}=(..., ), not {type(value).__name__}"
    )


def count(name: str, value: Any, lowest: int) -> None:
    """A whole number, not below `lowest`."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    require(whole and value >= lowest, f"{name} = {value!r} is not a whole number >= {lowest}")


def fits(function: Callable, arguments: int) -> bool:
    """Whether a user's function can be called with so many arguments; true where it has no signature."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # of some compiled functions
        return True
    try:
        signature.bind(*range(arguments))
    except TypeError:
        return False
    return True


def takes(name: str, function: Any, *arguments: str) -> None:
    """What is no function, or one of these arguments: known before anything is meshed."""
    require(
        not callable(function) or fits(function, len(arguments)),
        f"{name} must be a function of {len(arguments)} argument{'s' * (len(arguments) > 1)} ({', '.join(arguments)})",
    )


def chosen(name: str, where: Callable, points: np.ndarray) -> np.ndarray:
    """(n,) bool: the points (n, d) that a user's function chooses. Raises InputError, naming it, where that fails."""
    mask = called(name, where, (points.copy(),), (len(points),))
    strange: Any = [] if mask.dtype == bool else mask[~np.isin(mask, (0, 1))]  # NaN or indices
    require(
        len(strange) == 0,
        f"{name} must give True or False a vertex, not {mask.dtype} values such as {strange[0] if len(strange) else 0}",
    )
    return mask.astype(bool)


def near(name: str, place: np.ndarray, points: np.ndarray, whose: str) -> None:
    """A rest position (d,) not far outside the box around points (n, d)."""
    low, high = points.min(axis=0), points.max(axis=0)
    slack = FAR_OUTSIDE * np.linalg.norm(high - low)
    require(
        bool(np.all(place >= low - slack) and np.all(place <= high + slack)),
        f"{name} = {tuple(place.tolist())} lies far outside {whose}; it is a rest position, as placed",
    )


def called(name: str, function: Callable, arguments: tuple, shape: tuple[int, ...]) -> np.ndarray:
    """The result of a user's function, which must be an array of this shape."""
    try:
        result = np.asarray(function(*arguments))
    except Exception as error:
        raise InputError(f"{name} failed: {type(error).__name__}: {' '.join(str(error).split())}") from error
    require(result.shape == shape, f"{name} must give an array of shape {shape}, not {result.shape}")
    return result
