"""Scenes that several studies run, and what scene files of studies share. SI units, y up."""

from collections.abc import Callable, Mapping

from pdvol import Gravity, InputError, Plane, Scene

DOWN = Gravity((0.0, -9.81, 0.0))
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor")
ORIGIN, X_AXIS, Z_AXIS = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def named(scenes: Mapping[str, Callable[..., Scene]], name: str, *words: object, **settings: object) -> Scene:
    """The scene that the function `name` of `scenes` makes.

    Raises
    ------
    InputError
        There is no function of that name.
    """
    if name not in scenes:
        raise InputError(f"there is no scene {name!r}; choose one of {', '.join(scenes)}")
    return scenes[name](*words, **settings)
