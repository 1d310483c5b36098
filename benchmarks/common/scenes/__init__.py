"""Scenes that several studies run, and what scene files of studies share. SI units, y up."""

from collections.abc import Callable, Mapping
from dataclasses import fields, replace

import numpy as np

from pdvol import Barrier, Friction, Gravity, InputError, Plane, Scene, Solid

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


def solid(points: np.ndarray, cells: np.ndarray) -> Solid:
    """A Solid of one region from points (n, d) [m] and cells (m, d + 1), which are turned to be positive."""
    cells = np.array(cells, dtype=np.int32)
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells[negative, :2] = cells[negative, 1::-1]
    return Solid(np.array(points, dtype=float), cells, np.zeros(len(cells), np.int32))


def grid(size: tuple[float, float], cuts: tuple[int, int], corner: tuple[float, float] = (0.0, 0.0)) -> Solid:
    """A rectangle [m] as triangles, from its lower left corner on."""
    x, y = np.meshgrid(*(np.linspace(0.0, length, n + 1) for length, n in zip(size, cuts, strict=True)))
    row = cuts[0] + 1
    a = (np.arange(cuts[1])[:, None] * row + np.arange(cuts[0])).ravel()
    cells = np.vstack([np.column_stack([a, a + 1, a + row + 1]), np.column_stack([a, a + row + 1, a + row])])
    return solid(np.column_stack([x.ravel(), y.ravel()]) + corner, cells)
