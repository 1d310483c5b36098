"""Controls of a live page, made from the parameters of a scene function."""

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

from pdvol.errors import InputError
from pdvol.runs.scene_file import load_shot, scene_parameters
from pdvol.studio.wedge.variation import value_text
from pdvol.studio.wedge.vary import Vary, parsed_varies

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
    ranges = {one.name: _wanted(one, word) for one, word in zip(parsed_varies(vary), vary, strict=True)}
    parameters = scene_parameters(file)
    made = []
    for name, parameter in parameters.items():
        value = settings.get(name, None if parameter.default is inspect.Parameter.empty else parameter.default)
        wanted = ranges.pop(name) if name in ranges else Vary(name, (), _annotated(parameter.annotation))
        made.append(_control(name, value, wanted))
    for name, wanted in ranges.items():
        first = wanted.ends[0] if wanted.ends else wanted.values[0]
        own = settings.get(name, getattr(shot.scene, name, getattr(shot.scene.solver, name, first)))
        # An unknown name is the same mistake as after --set; the message is that of `load_shot`.
        load_shot(file, {**settings, name: first})
        made.append(_control(name, own, wanted))
    return made


def _wanted(vary: Vary, word: str) -> Vary:
    """A range or a list that a control can show; the number of values of `A:B:N` is left."""
    if len({value_text(value) for value in vary.ends or vary.values}) < 2:
        raise InputError(f"--vary {word}: write name=low:high or name=one,another")
    return vary


def _control(name: str, value: Any, wanted: Vary) -> Control:
    """With the range or the list that is wanted; a `Vary` of neither leaves the choice to the value."""
    if isinstance(value, bool):
        return Control(name, "checkbox", value)
    if wanted.ends is None and wanted.values:
        texts = dict.fromkeys([value_text(value), *map(value_text, wanted.values)])
        return Control(name, "choice", value, choices=tuple(texts))
    ends, number = wanted.ends, isinstance(value, int | float)
    if ends is None and number and math.isfinite(value):
        ends = _around(value)
    if ends is None or not number:
        return Control(name, "text", value)
    low, high = min(*ends, value), max(*ends, value)
    if all(isinstance(n, int) for n in (value, *ends)):
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


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
