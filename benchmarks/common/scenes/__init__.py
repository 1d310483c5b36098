"""Scenes that several studies run, and what scene files of studies share. SI units, y up."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace

from pdvol import Barrier, Friction, Gravity, InputError, Plane, Scene

DOWN = Gravity((0.0, -9.81, 0.0))
FLOOR = Plane((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), name="floor")
FIRST_ORDER = {"integrator": "implicit_euler", "elements": "linear", "feedback": 0.0}
"""Settings of the model of the paper, of the peers and of pdvol's first versions."""
ORIGIN, X_AXIS, Z_AXIS = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)


def falling(bodies, steps: int, dt: float = 0.01, mu: float | None = None, **more) -> Scene:
    """A scene with gravity, a floor, the default barrier, and friction where there is a coefficient; `more` of Scene
    comes instead of these.
    """
    contact: tuple = (Barrier(),) if mu is None else (Barrier(), Friction(mu))
    usual = {"loads": (DOWN,), "obstacles": (FLOOR,), "contact": contact}
    return Scene(tuple(bodies), dt=dt, steps=steps, **{**usual, **more})


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


def first_order(scene: Scene) -> Scene:
    """The same scene with `FIRST_ORDER`; a setting that the imported pdvol does not have yet is left out."""
    known = {field.name for field in fields(scene)}
    return replace(scene, **{name: value for name, value in FIRST_ORDER.items() if name in known})
