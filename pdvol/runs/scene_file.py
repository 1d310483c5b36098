"""A scene file and its parameters: loading, settings, and a description by which shots are compared."""

import ast
import inspect
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pdvol.errors import InputError, PdvolError
from pdvol.registry import STUDIO
from pdvol.runs.fingerprint import describe
from pdvol.runs.known_scenes import allow
from pdvol.runs.scene_modules import error_text, load_module
from pdvol.scene import Hand, Pascal, Relative, Scene
from pdvol.scene.element import files_beside
from pdvol.scene.scene import SETTINGS

IN_MEMORY = "the run was made from a scene in memory; pass the scene again: pdvol.run(scene, out, resume=True)"

DEFAULTS = {
    "integrator": "implicit_euler",
    "feedback": 0.0,
    "feedback_modes": "rigid",
    "attachments": [],
    "muscles": [],
    "elements": "linear",
    "pulls": [],
}
"""What a description leaves out, as those of runs stored before there was a choice do."""


@dataclass(frozen=True)
class Shot:
    """A scene and where it came from.

    Attributes
    ----------
    file : the scene file; None for a scene made in memory
    parameters : what `--set` gave, by name
    """

    file: Path | None
    parameters: Mapping
    scene: Scene

    def __post_init__(self) -> None:
        # At once: what functions read may change while they are called.
        object.__setattr__(self, "_described", describe(self.scene))

    @property
    def name(self) -> str:
        """The file's name without its ending; the scene's own name where there is no file."""
        return self.scene.name if self.file is None else self.file.stem

    def description(self) -> dict:
        """The scene as JSON, without its number of steps: a longer run has the same scene."""
        found: dict = vars(self)["_described"]
        # without, as in runs stored before there was a choice
        bodies = [{k: v for k, v in b.items() if k != "elements" or v is not None} for b in found["bodies"]]
        left_out = ("steps", "solver", "name", *(key for key, value in DEFAULTS.items() if found.get(key) == value))
        return {key: value for key, value in {**found, "bodies": bodies}.items() if key not in left_out}

    def kept(self) -> dict:
        """Its entries in `run.json`; the scene file's path is empty for a scene made in memory."""
        file, parameters = "" if self.file is None else str(self.file), kept_value(self.parameters)
        return {"scene_file": file, "parameters": parameters, "description": self.description()}


def parse_settings(words: Sequence[str]) -> dict:
    """`["mu=0.3", "surface=cow.obj"]` as a dictionary of values."""
    settings = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name.replace(".", "_").isidentifier():
            raise InputError(f"--set {word}: write name=value")
        settings[name] = parse_value(text)
    return settings


def parse_value(text: str) -> Any:
    """A Python literal, `Relative(1e-3)`, `Pascal(1e4)`, or the text itself."""
    marked = re.fullmatch(r"(Relative|Pascal)\((.+)\)", text.strip())
    try:
        value = ast.literal_eval(marked[2] if marked else text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):  # the last two: nested too deeply
        return text
    return {"Relative": Relative, "Pascal": Pascal}[marked[1]](value) if marked else value


def stored_file(info: Mapping) -> Path:
    """The scene file that `run.json` names.

    Raises
    ------
    InputError
        The run was made from a scene in memory, or its file is gone.
    """
    file = info.get("scene_file", "")
    if not file:
        raise InputError(IN_MEMORY)
    if not Path(file).is_file():
        raise InputError(f"its scene file {file} is gone")
    return Path(file)


def stored_shot(info: Mapping, trusted: bool = False) -> Shot:
    """The shot that `run.json` describes, with its settings and steps; raises as `stored_file` and `load_shot`."""
    settings = {name: stored_value(value) for name, value in info["parameters"].items()}
    shot, channel = load_shot(stored_file(info), settings, info["steps"], trusted), info.get("channel")
    hand = Hand(Path(info.get("hand", "")), None if channel is None else Path(channel))
    return with_hand(shot, hand, info["steps"]) if "hand" in info else shot


def with_hand(shot: Shot, hand: Hand, steps: int) -> Shot:
    """The same shot with a hand, and so many steps."""
    return replace(shot, scene=replace(shot.scene, hand=hand, steps=steps))


def both_described(info: Mapping, shot: Shot) -> tuple[dict, dict]:
    """The descriptions in `run.json` and of a shot, with what these leave out."""
    return {**DEFAULTS, **info["description"]}, {**DEFAULTS, **shot.description()}


def kept_value(value: Any) -> Any:
    """A setting, or settings by name, for `run.json`, from which `stored_value` makes it again."""
    if isinstance(value, Mapping):
        return {name: kept_value(one) for name, one in value.items()}
    if isinstance(value, float) and not math.isfinite(value):  # JSON has no such number
        return {"number": str(value)}
    return [kept_value(part) for part in value] if isinstance(value, tuple | list) else value


def stored_value(value: Any) -> Any:
    """A setting as `run.json` keeps it: `Relative`, `Pascal` and what is not finite are objects with one key there."""
    match value:
        case list():
            return [stored_value(part) for part in value]
        case {"number": str(text), **others} if not others:
            return float(text)
        case {"fraction": number, **others} if not others:
            return Relative(number)
        case {"pascals": number, **others} if not others:
            return Pascal(number)
    return value


def load_shot(
    file: str | Path, settings: Mapping | None = None, steps: int | None = None, trusted: bool = True
) -> Shot:
    """Runs a scene file's `scene(**parameters)`; settings of the solver and the penalty go there instead.

    Parameters
    ----------
    trusted : whether it may run if it, or a module beside it, has not run here before, with these texts in settings

    Raises
    ------
    InputError
        The file is missing or broken, has no `scene`, must not run, or a name is unknown; one line says which.
    """
    file, settings = Path(file), dict(settings or {})
    make = _scene_function(file, trusted)
    allow(file, settings, trusted)
    given = {name: settings[name] for name in check_names(file, settings, make)}
    try:
        with files_beside(file):
            scene = make(**given)
    except PdvolError:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(
            f"{file.name}: scene({', '.join(f'{k}={v!r}' for k, v in given.items())}) failed: {error_text(error)}"
        ) from error
    if not isinstance(scene, Scene):
        raise InputError(f"{file.name}: scene() returned {type(scene).__name__}, not a pdvol.Scene")
    scene = scene.with_settings(**{name: value for name, value in settings.items() if name not in given})
    if steps is not None:
        scene = replace(scene, steps=steps)
    return Shot(file.resolve(), settings, replace(scene, name=file.stem))


def scene_parameters(file: str | Path) -> dict[str, inspect.Parameter]:
    """The parameters of a scene file's `scene(**parameters)`, by name, in its order; raises as `load_shot`.

    Annotations that are text are evaluated where they can be.
    """
    make = _scene_function(Path(file))
    try:
        signature = inspect.signature(make, eval_str=True)
    except Exception:  # an annotation may name what is not there
        signature = inspect.signature(make)
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return {name: parameter for name, parameter in signature.parameters.items() if parameter.kind in kinds}


def check_names(file: Path, names: Iterable[str], make: Callable[..., Scene] | None = None) -> list[str]:
    """Names that are no settings of every scene: a scene file's `scene`, or `make`, takes them, or InputError."""
    parameters = inspect.signature(make or _scene_function(file)).parameters
    anything = any(p.kind is p.VAR_KEYWORD for p in parameters.values())
    general = SETTINGS.keys() - set(parameters)
    own = [name for name in names if name not in general]
    for name in own:
        if name not in parameters and not anything:
            raise InputError(
                f"{file.name} has no parameter {name!r}; there are {', '.join(parameters)} and every scene's "
                f"{', '.join(sorted(general))}"
            )
    return own


def _scene_function(file: Path, trusted: bool = True) -> Callable[..., Scene]:
    if file.suffix.lower() == ".json" and file.is_file():
        allow(file, trusted=trusted)
        return STUDIO["polyfem_scene"](file)
    with files_beside(file):
        make = getattr(load_module(file, trusted), "scene", None)
    if not callable(make):
        raise InputError(f"{file} defines no scene(**parameters); it must return a pdvol.Scene")
    return make
