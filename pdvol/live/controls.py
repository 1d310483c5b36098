"""Controls of a live page, made from the parameters of a scene function."""

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pdvol.errors import InputError
from pdvol.explore.variation import value_text
from pdvol.runs.scene_file import load_shot, parse_value, scene_parameters

SLIDER_POSITIONS = 200  # of a slider of real numbers, about
SPREAD = (0.25, 2.0)  # ends of a slider whose range nobody gave, over the value


@dataclass(frozen=True)
class Control:
    """How one value is changed.

    Attributes
    ----------
    name : of the parameter
    kind : "slider", "choice", "checkbox" or "text"
    value : at the start; `text` is what a text field shows
    low, high, step : of a slider
    choices : of a choice, as text
    """

    name: str
    kind: str
    value: Any
    low: float = 0.0
    high: float = 0.0
    step: float = 0.0
    choices: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """The value as `--set` reads it."""
        return value_text(self.value)


def controls(file: Path, settings: Mapping[str, Any], vary: Sequence[str]) -> list[Control]:
    """A control for each parameter of a scene file, and for each solver setting that `vary` names.

    Parameters
    ----------
    settings : what `--set` gives, by name
    vary : `NAME=A:B` for a slider, `NAME=A,B,C` for a choice

    Raises
    ------
    InputError
        The scene or a range is wrong.
    """
    shot = load_shot(file, settings)
    ranges = dict(_range(text) for text in vary)
    parameters = scene_parameters(file)
    made = []
    for name, parameter in parameters.items():
        value = settings.get(name, None if parameter.default is inspect.Parameter.empty else parameter.default)
        made.append(_control(name, value, ranges.pop(name, None) or _annotated(parameter.annotation)))
    for name, values in ranges.items():
        own = settings.get(name, getattr(shot.scene, name, getattr(shot.scene.solver, name, values[0])))
        # An unknown name is the same mistake as after --set; the message is that of `load_shot`.
        load_shot(file, {**settings, name: values[0]})
        made.append(_control(name, own, values))
    return made


def _control(name: str, value: Any, values: tuple | None) -> Control:
    if isinstance(value, bool):
        return Control(name, "checkbox", value)
    if values is not None and len(values) != 2:
        texts = dict.fromkeys([value_text(value), *map(value_text, values)])
        return Control(name, "choice", value, choices=tuple(texts))
    number = isinstance(value, int | float)
    if values is None and number and math.isfinite(value):
        values = _around(value)
    if values is None or not number:
        return Control(name, "text", value)
    low, high = min(*values, value), max(*values, value)
    if all(isinstance(n, int) for n in (value, *values)):
        return Control(name, "slider", value, low, high, 1)
    return Control(name, "slider", float(value), float(low), float(high), _step(high - low))


def _around(value: float) -> tuple[float, float]:
    """A range for a number of which nothing else is known."""
    if isinstance(value, int):
        least, most = sorted((value // 4, 2 * value))
        return (0, 10) if value == 0 else (max(1, least) if value > 0 else least, most)
    if value == 0.0:
        return -1.0, 1.0
    low, high = sorted(float(f"{value * factor:.3g}") for factor in SPREAD)
    return low, high


def _step(width: float) -> float:
    """A round step that divides a range into about `SLIDER_POSITIONS` parts."""
    rough = width / SLIDER_POSITIONS
    if rough <= 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(rough))
    return float(f"{next(n for n in (1, 2, 5, 10) if n * power >= 0.999 * rough) * power:.3g}")


def _annotated(annotation: Any) -> tuple | None:
    """The range of `Annotated[float, (low, high)]`, or of a marker with `low` and `high`."""
    if get_origin(annotation) is not Annotated:
        return None
    for extra in get_args(annotation)[1:]:
        ends = extra if isinstance(extra, tuple) else (getattr(extra, "low", None), getattr(extra, "high", None))
        if len(ends) == 2 and all(_is_number(end) for end in ends) and ends[0] < ends[1]:
            return ends
    return None


def _range(text: str) -> tuple[str, tuple]:
    """`offset=-0.1:0.1` or `spin=0,2,4`; a number of values after a second colon, as `pdvol wedge` has it, is left."""
    name, equals, values = text.partition("=")
    if not equals or not name.replace(".", "_").isidentifier():
        raise InputError(f"--vary {text}: write name=low:high or name=one,another")
    if ":" in values:
        ends = tuple(parse_value(part) for part in values.split(":")[:2])
        if not all(_is_number(end) for end in ends) or not ends[0] < ends[1]:
            raise InputError(f"--vary {text}: {values!r} is no range; write low:high, two numbers")
        return name, ends
    found = tuple(parse_value(part) for part in values.split(","))
    if len(found) < 2 or "" in found:
        raise InputError(f"--vary {text}: write name=low:high or name=one,another")
    return name, found if len(found) != 2 else (*found, found[0])


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
