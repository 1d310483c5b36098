"""Checks of the values in a scene's dataclasses: each raises an error of one line that names the value."""

import inspect
import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from pdvol.errors import InputError

Check = Callable[[str, Any], None]
"""Raises InputError unless a value, whose name in messages comes first, is legal."""
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


def _shown(value: Any) -> str:
    return " ".join(repr(value).split())


def finite(name: str, value: Any, lowest: float = -np.inf, highest: float = np.inf) -> None:
    """A finite number from `lowest` to `highest`."""
    number = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    require(number and abs(value) <= HUGE, f"{name} = {_shown(value)} is not a finite number")
    require(value >= lowest, f"{name} = {value!r} is below {lowest:g}")
    require(value <= highest, f"{name} = {value!r} must be at most {highest:g}")


def positive(name: str, value: Any, highest: float = np.inf) -> None:
    """A finite number above zero."""
    finite(name, value)
    require(value > 0, f"{name} = {value!r} must be positive")
    finite(name, value, highest=highest)


def count(name: str, value: Any, lowest: int, highest: float = np.inf) -> None:
    """A whole number from `lowest` to `highest`."""
    whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
    require(whole and value >= lowest, f"{name} = {value!r} is not a whole number >= {lowest}")
    require(value <= highest, f"{name} = {value!r} must be at most {highest}")


def moment(name: str, value: Any) -> None:
    """A time [s], which may be infinite."""
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    require(number and value >= 0.0, f"{name} = {value!r} must be a time, not negative (inf: never)")


def vector(name: str, value: Any) -> None:
    """Two or three finite components, as `plain` leaves them."""
    sized = isinstance(value, tuple) and len(value) in (2, 3)
    require(sized, f"{name} = {_shown(value)} must have two or three components")
    for component in value:
        finite(name, component)


def direction(name: str, value: Any) -> None:
    """A vector of any length but zero."""
    vector(name, value)
    require(np.linalg.norm(value) > 0, f"{name} = {value!r} has no direction")


def sequence(name: str, value: Any) -> None:
    """A tuple or a list."""
    require(isinstance(value, (tuple, list)), f"{name} must be a tuple, as ({_shown(value)},), not {_shown(value)}")


def ascending(name: str, value: Any) -> None:
    """A sequence of finite numbers, each larger than the one before."""
    sequence(name, value)
    for number in value:
        finite(name, number)
    require(all(a < b for a, b in zip(value, value[1:], strict=False)), f"{name} = {value!r} must ascend")


def text(name: str, value: Any) -> None:
    """Text."""
    require(isinstance(value, str), f"{name} must be text, not {_shown(value)}")


def flag(name: str, value: Any) -> None:
    """True or False."""
    require(isinstance(value, bool), f"{name} = {value!r} must be True or False")


def anything(name: str, value: Any) -> None:
    """Of a field that has a check of its own: it is kept `plain`."""


def choice(*names: str) -> Check:
    """One of these names."""
    listed = " or ".join(filter(None, (", ".join(names[:-1]), names[-1])))
    return lambda name, value: require(value in names, f"{name} = {value!r} must be {listed}")


def optional(check: Check, nothing: Any = None) -> Check:
    """A value that may be left out."""
    return lambda name, value: None if value is nothing or value == nothing else check(name, value)


def instance(kind: type, more: str = "") -> Check:
    """An object of a class."""
    return lambda name, value: require(
        isinstance(value, kind), f"{name} must be a {kind.__name__}, not {type(value).__name__}{more}"
    )


def several(kinds: Any, shown: str) -> Check:
    """A sequence of objects of a class, or of a union of some."""

    def of_a_kind(name: str, value: Any) -> None:
        sequence(name, value)
        for item in value:
            require(isinstance(item, kinds), f"{name} holds {shown}, not {type(item).__name__}")

    return of_a_kind


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


def mask(name: str, value: Any) -> None:
    """A function that chooses points."""
    require(callable(value), f"{name} = {value!r} must be a function of rest positions (n, d) giving a mask (n,)")
    takes(name, value, "X")


def function_or(check: Check, *arguments: str) -> Check:
    """A function of these arguments, or a value that fits."""
    return lambda name, value: takes(name, value, *arguments) if callable(value) else check(name, value)


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


def called(name: str, function: Callable, arguments: tuple, *shapes: tuple[int, ...]) -> np.ndarray:
    """The result of a user's function, which must be an array of one of these shapes."""
    try:
        result = np.asarray(function(*arguments))
    except Exception as error:
        raise InputError(f"{name} failed: {type(error).__name__}: {' '.join(str(error).split())}") from error
    wanted = " or ".join(map(str, shapes))
    require(result.shape in shapes, f"{name} must give an array of shape {wanted}, not {result.shape}")
    return result


def numbers(name: str, function: Callable, arguments: tuple, shape: tuple[int, ...], when: str = "") -> np.ndarray:
    """The same as floats, all of them finite; `when` is the time in messages, as " at t = 0.1 s"."""
    result = called(name, function, arguments, shape)
    require(np.issubdtype(result.dtype, np.number), f"{name} gives no numbers, but {result.dtype}")
    result = result.astype(float)
    require(bool(np.isfinite(result).all()), f"{name} gives NaN or infinity{when}")
    return result
