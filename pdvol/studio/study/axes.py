"""The settings that a study varies, and the values it tries."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pdvol.errors import InputError
from pdvol.registry import ELEMENTS, INTEGRATORS
from pdvol.runs.scene_file import Shot, load_shot
from pdvol.scene import Barrier, Friction, Scene
from pdvol.studio.wedge.variation import Base, Variation, number, times
from pdvol.studio.wedge.vary import parsed_varies

# Factors of the scene's own value, the most telling ones first. Powers of two for the time step: all runs share times.
FACTORS = {
    "dt": (2.0, 0.5, 4.0, 0.25),
    "tolerance": (10.0, 0.1, 3.0, 100.0),
    "dhat": (2.0, 0.5),
    "linear_rtol": (10.0, 0.1),
}
RELATIVE_TOLERANCES = (0.01, 0.003, 0.03)  # fractions of the change of velocity
LAGS = (3, 10)  # solves with friction lagged anew in a step: once more or twice more hardly differs from one
FEEDBACKS = (0.0, 0.2)  # fractions of the drift from the level below
DEFAULT_AXES = ("dt", "integrator", "elements", "tolerance", "dhat", "level")
# Exponents of a first guess of the cost, until it is measured: steps are cheaper where they are short.
COST_EXPONENTS = {"dt": -0.85, "tolerance": -0.06, "dhat": -0.05, "friction.iterations": 0.8}


@dataclass(frozen=True)
class Axis:
    """One setting that is varied.

    Attributes
    ----------
    name : as `--set` has it
    base : the scene's own value
    others : the values to try
    """

    name: str
    base: Any
    others: tuple[Any, ...]

    def variations(self, method: str) -> list[Variation]:
        """One for each other value, all else as in the scene."""
        return [Variation.of({self.name: value}, method) for value in self.others]


def chosen_axes(words: Sequence[str], shot: Shot) -> tuple[list[Axis], bool]:
    """The axes that `--vary` names, and whether levels simulated alone are compared with progressive ones.

    Parameters
    ----------
    words : each with names separated by commas, `dt,level`, or with one name and its values, as `pdvol wedge` reads
        them: `dt=0.01,0.02`, `dt=0.01:0.02:3`; `dt=0.01:0.02` are two values. A scene parameter may be named, too,
        with values. None: `DEFAULT_AXES` as far as the scene has them.

    Raises
    ------
    InputError
        A name is unknown, the scene lacks what it varies, or it needs values.
    """
    file = Base.of(shot).scene
    wanted = _wanted(words) if words else {name: () for name in DEFAULT_AXES if _has(shot.scene, name)}
    axes: list[Axis] = []
    for name, values in wanted.items():
        if name == "level":
            continue
        if not _has(shot.scene, name):
            raise InputError(f"--vary {name}: the scene has no {'Friction' if 'friction' in name else 'Barrier'}")
        base = base_value(shot, name)
        given = values or _others(name, base)
        for value in given:
            load_shot(file, {**shot.parameters, name: value})  # a wrong name or value is an error now, not later
        axes.append(Axis(name, base, tuple(value for value in given if value != base)))
    return axes, "level" in wanted


def _wanted(words: Sequence[str]) -> dict[str, tuple[Any, ...]]:
    """The values that each name is given; none where pdvol chooses them."""
    named = [name.strip() for word in words if "=" not in word for name in word.split(",")]
    if any(word.count("=") > 1 for word in words):
        raise InputError("--vary: give each setting that has values a --vary of its own")
    varies = parsed_varies([word for word in words if "=" in word], {"level": "--levels A:B"})
    names = [*named, *(vary.name for vary in varies)]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"--vary names {name} twice")
    return dict.fromkeys(named, ()) | {vary.name: vary.values or tuple(vary.ends or ()) for vary in varies}


def base_value(shot: Shot, name: str) -> Any:
    """The value of a setting in a shot as it is; None for a parameter whose default is not known."""
    scene = shot.scene
    barrier, friction = _contact(scene)
    known = {
        "dt": scene.dt,
        "tolerance": scene.solver.tolerance,
        "linear_rtol": scene.solver.linear_rtol,
        "integrator": scene.integrator,
        "elements": scene.elements,
        "feedback": scene.feedback,
        "dhat": barrier.dhat if barrier else None,
        "friction.iterations": friction.iterations if friction else None,
    }
    return known.get(name, getattr(scene.solver, name, shot.parameters.get(name)))


def cost_factor(name: str, value: Any, base: Any) -> float:
    """A first guess of a run's cost, relative to the one with a setting's base value."""
    mine, its = number(value), number(base)
    if name not in COST_EXPONENTS or not mine or not its:
        return 1.0
    return float((mine / its) ** COST_EXPONENTS[name])


def _others(name: str, base: Any) -> Sequence[Any]:
    if name in FACTORS:
        return tuple(times(base, factor) for factor in FACTORS[name])
    if name == "integrator":
        return tuple(INTEGRATORS)
    if name == "elements":
        return ELEMENTS
    if name == "feedback":
        return FEEDBACKS
    if name == "friction.iterations":
        return LAGS
    if name == "relative_tolerance":
        return RELATIVE_TOLERANCES
    raise InputError(f"--vary {name} needs values, as in --vary {name}=A:B")


def _has(scene: Scene, name: str) -> bool:
    """Whether a scene has what a setting varies."""
    barrier, friction = _contact(scene)
    return {"dhat": barrier, "friction.iterations": friction}.get(name, scene) is not None


def _contact(scene: Scene) -> tuple[Barrier | None, Friction | None]:
    barrier = next((c for c in scene.contact if isinstance(c, Barrier)), None)
    return barrier, next((c for c in scene.contact if isinstance(c, Friction)), None)
