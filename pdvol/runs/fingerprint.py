"""A scene as plain JSON: `run.json` keeps it, and a stored run's scene is compared with it.

Values are kept as they are; arrays, files and code as digests of their contents. A function of the user's has what it
reads when it is called: globals, what it closes over, the object that it is bound to. Code of Python, of installed
packages and of pdvol counts as unchanging.
"""

import functools
import hashlib
import inspect
import json
import math
import re
import sysconfig
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from pdvol.registry import STUDIO
from pdvol.scene.element import NOT_SIMULATED
from pdvol.scene.point_caches import USD_FILES

PER_LEVEL = ("vertices", "shape")  # of a body: lists with an entry per level
PAIRED = (".node", ".ele")  # endings of the two files of one mesh
NAMING = (".xdmf", ".pvd", ".pvtu", ".vtm")  # endings of files that name others beside them, with their data
ADDED = ("reads", "class")  # keys that older stored runs lack
NOT_COMPARED = "not compared"
DEEPEST = 12  # objects within each other: deeper ones are not followed
SHOWN = 100  # characters of one value in a message
PACKAGES = {"site-packages", "dist-packages"}  # folders of installed packages
UNCHANGING = (sysconfig.get_paths()["stdlib"], Path(__file__).resolve().parents[1])  # Python's folder and pdvol's


def describe(thing: Any, within: tuple[int, ...] = ()) -> Any:
    """Dataclasses, arrays, paths, functions and what these read as JSON. Fields that do not change the simulation are
    left out.

    `within` are the identities of what is being described: what reads itself is named there.
    """
    if is_dataclass(thing) and not isinstance(thing, type):
        psi = getattr(thing, "psi", None)
        own = {"psi": describe(psi)} if getattr(psi, "__module__", "pdvol").split(".")[0] != "pdvol" else {}
        if callable(thing) and not is_library(type(thing)):
            own["class"] = describe(type(thing), within)
        named = {f.name: getattr(thing, f.name) for f in fields(thing) if NOT_SIMULATED not in f.metadata}
        return {"type": type(thing).__name__, **own, **{key: describe(value, within) for key, value in named.items()}}
    match thing:
        case np.ndarray():
            return {"array": list(thing.shape), "digest": _digest(np.ascontiguousarray(thing).tobytes())}
        case np.number() | np.bool_():
            return describe(thing.item())
        case float():
            return thing if math.isfinite(thing) else None  # as in JSON, which has no such number
        case None | bool() | int():
            return thing
        case tuple() | list():
            return [describe(item, within) for item in thing]
        case dict():
            return {str(key): describe(value, within) for key, value in thing.items()}
        case str() | Path() if isinstance(thing, Path) or Path(thing).suffix:
            path = Path(thing)
            return {"file": path.name, **({"digest": _digest(_contents(path))} if path.is_file() else {})}
        case str():
            return thing
        case set() | frozenset():
            return sorted(json.dumps(describe(item, within)) for item in thing)
        case bytes():
            return {"bytes": len(thing), "digest": _digest(thing)}
    return _object(thing, within)


def _object(thing: Any, within: tuple[int, ...]) -> Any:
    """A function, a class, a module or another object: its text, and what it reads or has as attributes."""
    code = callable(thing) or isinstance(thing, ModuleType)
    name = {"function" if code else "type": getattr(thing, "__qualname__", type(thing).__name__)}
    if id(thing) in within:
        return name
    shown = " at 0x" not in repr(thing)
    known = hasattr(thing, "__dict__") or not is_library(type(thing)) or shown
    if len(within) > DEEPEST or not known:
        return {**name, NOT_COMPARED: True}
    if shown and not code:
        return repr(thing)
    inside = (*within, id(thing))
    reads = {key: describe(value, inside) for key, value in _reads(thing).items()}
    if not code:
        return {**name, **reads}
    text = _text(thing)
    if isinstance(thing, FunctionType | MethodType):
        # They are in the digest because runs were stored before functions had `reads`.
        text += f"{[describe(cell.cell_contents, inside) for cell in thing.__closure__ or ()]}"
        text += f"{describe(thing.__defaults__)}"
    return {**name, "digest": _digest(text.encode()), **({"reads": reads} if reads else {})}


def _text(thing: Any) -> str:
    """The source of a function; that of its functions for a class, and the file's for a module."""
    if isinstance(thing, ModuleType):
        return Path(str(thing.__file__)).read_text(encoding="utf-8", errors="replace")
    if isinstance(thing, type):
        return "\n".join(_text(function) for function in _functions(thing))
    if isinstance(thing, FunctionType | MethodType):
        try:
            return inspect.getsource(thing)
        except (OSError, TypeError):
            return _bytes(thing.__code__)
    return ""


def _bytes(code: CodeType) -> str:
    """A function without a source, as one that was typed in."""
    constants = [_bytes(value) if isinstance(value, CodeType) else repr(value) for value in code.co_consts]
    return f"{code.co_code.hex()}{constants}{code.co_names}"


def _reads(thing: Any) -> dict[str, Any]:
    """What a callable, class or module reads besides its own text, by name; an object's attributes."""
    if isinstance(thing, functools.partial):
        return {"function": thing.func, "arguments": thing.args, **thing.keywords}
    if isinstance(thing, MethodType):
        return {"self": thing.__self__, **_reads(thing.__func__)}
    if isinstance(thing, FunctionType):
        known = thing.__globals__
        found = {name: known[name] for name in sorted(_names(thing.__code__)) if name in known}
        kinds = ModuleType | type | FunctionType | BuiltinFunctionType
        return {name: value for name, value in found.items() if not (isinstance(value, kinds) and is_library(value))}
    if isinstance(thing, type):
        return {name: value for function in _functions(thing) for name, value in _reads(function).items()}
    if isinstance(thing, ModuleType):
        return {n: v for n, v in vars(thing).items() if isinstance(v, ModuleType) and not is_library(v)}
    own = {} if is_library(type(thing)) else {"class": type(thing)}
    slots = [name for base in type(thing).__mro__ for name in getattr(base, "__slots__", ()) if hasattr(thing, name)]
    return {**own, **{name: getattr(thing, name) for name in slots}, **getattr(thing, "__dict__", {})}


def _names(code: CodeType) -> set[str]:
    """The globals that code names, also within functions of its own."""
    return set(code.co_names).union(*(_names(inner) for inner in code.co_consts if isinstance(inner, CodeType)))


def is_library(thing: Any) -> bool:
    """Whether a module, function, class or object belongs to Python, to an installed package or to pdvol."""
    if isinstance(thing, ModuleType):
        file = getattr(thing, "__file__", None)
    else:
        thing = getattr(thing, "__func__", thing)
        cls = thing if isinstance(thing, type) else type(thing)
        functions = iter((thing,)) if isinstance(thing, FunctionType) else _functions(cls)
        file = next((function.__code__.co_filename for function in functions), None)
    if file is None:
        return True  # of C
    here = Path(file).resolve()
    typed_in = not Path(file).is_absolute()
    return not typed_in and (bool(PACKAGES & set(here.parts)) or any(here.is_relative_to(path) for path in UNCHANGING))


def _functions(cls: type) -> Iterator[FunctionType]:
    """The functions of a class and of those of the user's that it derives from."""
    for base in cls.__mro__:
        for value in vars(base).values():
            function = getattr(value, "__func__", getattr(value, "fget", value))
            if isinstance(function, FunctionType) and (base is cls or not is_library(function)):
                yield function


def not_compared(description: Any, where: str = "scene") -> list[str]:
    """Where a description has something of which nothing is known: another one in its place is not noticed."""
    if isinstance(description, dict):
        if NOT_COMPARED in description:
            return [f"{where} ({description.get('function', description.get('type'))})"]
        return [line for key, value in description.items() for line in not_compared(value, f"{where}.{key}")]
    if isinstance(description, list):
        return [line for i, value in enumerate(description) for line in not_compared(value, f"{where}[{i}]")]
    return []


def differences(old: Any, new: Any, where: str = "scene") -> list[str]:
    """Where two descriptions differ, field by field, as `scene.bodies[0].material.young: 1e5 -> 2e5`."""
    if old == new:
        return []
    if isinstance(old, dict) and isinstance(new, dict):
        new = {key: value for key, value in new.items() if key in old or key not in ADDED}
        if old.get("digest") != new.get("digest") and {**old, "digest": 0} == {**new, "digest": 0}:
            what = next((old[key] for key in ("file", "function") if key in old), "the array")
            return [f"{where}: the contents of {what} have changed"]
        if "array" in old and "array" in new:
            return [f"{where}: an array of shape {tuple(old['array'])} -> {tuple(new['array'])}"]
        keys = list(dict.fromkeys([*old, *new]))
        return [line for key in keys for line in differences(old.get(key), new.get(key), f"{where}.{key}")]
    if isinstance(old, list) and isinstance(new, list) and _entries(old + new):
        lines = [
            line for i, pair in enumerate(zip(old, new, strict=False)) for line in differences(*pair, f"{where}[{i}]")
        ]
        return lines + ([f"{where}: {len(old)} -> {len(new)} entries"] if len(old) != len(new) else [])
    return [f"{where}: {_short(old)} -> {_short(new)}"]


def differences_by_level(old: dict, new: dict) -> tuple[list[str], int, list[str]]:
    """The differences of two scenes in what all levels share; the number of coarsest levels whose own entries (vertex
    targets, listed meshes) agree; and the differences of the other levels.
    """
    if len(old.get("bodies", ())) != len(new.get("bodies", ())):
        return differences(old, new), 0, []
    own = lambda key, value: key in PER_LEVEL and isinstance(value, list)
    shared, listed = [], []
    for description in (old, new):
        bodies = description["bodies"]
        kept = [{key: None if own(key, value) else value for key, value in body.items()} for body in bodies]
        shared.append({**description, "bodies": kept})
        listed.append([{key: value for key, value in body.items() if own(key, value)} for body in bodies])
    agree = [
        next((i for i, (a, b) in enumerate(zip(one[key], other[key], strict=False)) if a != b), least)
        for one, other in zip(*listed, strict=True)
        for key in one.keys() & other.keys()
        if one[key] or other[key]
        for least in [min(len(one[key]), len(other[key]))]
    ]
    (old_rest, new_rest), (one, other) = shared, listed
    return differences(old_rest, new_rest), min(agree, default=0), differences(one, other, "scene.bodies")


def _entries(values: list) -> bool:
    return any(isinstance(value, (dict, list)) for value in values)


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."


def _contents(path: Path, seen: tuple[Path, ...] = ()) -> bytes:
    """The bytes of a file and of those that it names and is read with: the other one of a pair, pieces, layers."""
    suffix, names = path.suffix.lower(), [path]
    if suffix in PAIRED:
        names = [path.with_suffix(ending) for ending in PAIRED]
    elif suffix in USD_FILES:
        names += STUDIO["files_of_scene"](path)
    elif suffix in NAMING:
        others = re.findall(r"[^<>\"\s:]+\.[a-z]\w+", path.read_text(encoding="utf-8", errors="replace"))
        pieces = [path.parent / other for other in dict.fromkeys(others)]
        return path.read_bytes() + b"".join(_contents(one, (*seen, path)) for one in pieces if one not in (*seen, path))
    return b"".join(name.read_bytes() for name in names if name.is_file())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
