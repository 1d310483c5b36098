"""A scene as plain JSON: `run.json` keeps it, and a stored run's scene is compared with it."""

import hashlib
import json
import math
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import FunctionType, MethodType, ModuleType
from typing import Any

import numpy as np

from pdvol.scene.element import NOT_SIMULATED
from pdvol.scene.user_code import can_be_compared, is_library, name_of, reads_of, text_of

PER_LEVEL = ("vertices", "shape")  # of a body: lists with an entry per level
PAIRED = (".node", ".ele")  # endings of the two files of one mesh
ADDED = ("reads", "class")  # keys that older stored runs lack
NOT_COMPARED = "not compared"
DEEPEST = 12  # objects within each other: deeper ones are not followed
SHOWN = 100  # characters of one value in a message


def describe(thing: Any, within: tuple[int, ...] = ()) -> Any:
    """Dataclasses, arrays, paths and functions as JSON; arrays, files and functions as digests of their contents, and
    functions of the user's with what they read. Fields that do not change the simulation are left out.

    `within` are the identities of what is being described: what reads itself is named there.
    """
    if is_dataclass(thing) and not isinstance(thing, type):
        psi = getattr(thing, "psi", None)
        own = {"psi": describe(psi)} if getattr(psi, "__module__", "pdvol").split(".")[0] != "pdvol" else {}
        if callable(thing) and not is_library(type(thing)):
            own["class"] = describe(type(thing), within)
        named = {f.name: getattr(thing, f.name) for f in fields(thing) if NOT_SIMULATED not in f.metadata}
        return {
            "type": type(thing).__name__,
            **own,
            **{name: describe(value, within) for name, value in named.items()},
        }
    if isinstance(thing, np.ndarray):
        return {"array": list(thing.shape), "digest": _digest(np.ascontiguousarray(thing).tobytes())}
    if isinstance(thing, (tuple, list)):
        return [describe(item, within) for item in thing]
    if isinstance(thing, dict):
        return {str(key): describe(value, within) for key, value in thing.items()}
    if isinstance(thing, (np.integer, np.floating, np.bool_)):
        return describe(thing.item())
    if isinstance(thing, float) and not math.isfinite(thing):
        return None  # as in the JSON it will be compared with, which has no such number
    if thing is None or isinstance(thing, (bool, int, float)):
        return thing
    if isinstance(thing, (str, Path)):
        path = Path(thing)
        if isinstance(thing, Path) or path.suffix:
            return {"file": path.name, "digest": _digest(_contents(path))} if path.is_file() else {"file": path.name}
        return thing
    return _callable(thing, within) if callable(thing) or isinstance(thing, ModuleType) else _other(thing, within)


def _callable(thing: Any, within: tuple[int, ...]) -> dict:
    """A function, a class, a module or an object that can be called, with what it reads."""
    name, inside = {"function": name_of(thing)}, (*within, id(thing))
    if id(thing) in within:
        return name
    if len(within) > DEEPEST or not can_be_compared(thing):
        return {**name, NOT_COMPARED: True}
    reads = {key: describe(value, inside) for key, value in reads_of(thing).items()}
    own = {"reads": reads} if reads else {}
    if isinstance(thing, FunctionType | MethodType):
        cells = [describe(cell.cell_contents, inside) for cell in thing.__closure__ or ()]
        # The defaults of a function are part of what was stored before functions had `reads`.
        return {**name, "digest": _digest(f"{text_of(thing)}{cells}{describe(thing.__defaults__)}".encode()), **own}
    return {**name, "digest": _digest(text_of(thing).encode()), **own}


def _other(thing: Any, within: tuple[int, ...]) -> Any:
    """An object that a function reads: its attributes, or its text where that is no address."""
    if id(thing) in within:
        return {"type": name_of(thing)}
    if isinstance(thing, set | frozenset):
        return sorted(json.dumps(describe(item, within)) for item in thing)
    if isinstance(thing, bytes):
        return {"bytes": len(thing), "digest": _digest(thing)}
    if len(within) > DEEPEST or not can_be_compared(thing):
        return {"type": name_of(thing), NOT_COMPARED: True}
    if " at 0x" not in (text := repr(thing)):
        return text
    inside = (*within, id(thing))
    return {"type": name_of(thing), **{key: describe(value, inside) for key, value in reads_of(thing).items()}}


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
    shared: list[dict] = []
    listed: list[list[dict]] = []
    agree: list[int] = []
    for description in (old, new):
        bodies = [
            {key: None if isinstance(value, list) and key in PER_LEVEL else value for key, value in b.items()}
            for b in description["bodies"]
        ]
        shared.append({**description, "bodies": bodies})
        listed.append(
            [{key: b[key] for key in PER_LEVEL if isinstance(b.get(key), list)} for b in description["bodies"]]
        )
    for one, other in zip(*listed, strict=True):
        for key in one.keys() & other.keys():
            if one[key] or other[key]:
                pairs = zip(one[key], other[key], strict=False)
                agree.append(next((i for i, (a, b) in enumerate(pairs) if a != b), min(len(one[key]), len(other[key]))))
    return (
        differences(shared[0], shared[1]),
        min(agree, default=0),
        differences(listed[0], listed[1], "scene.bodies"),
    )


def _entries(values: list) -> bool:
    return any(isinstance(value, (dict, list)) for value in values)


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= SHOWN else f"{text[: SHOWN - 3]}..."


def _contents(path: Path) -> bytes:
    """The bytes of a file; of both where a mesh is a pair of files."""
    names = [path.with_suffix(ending) for ending in PAIRED] if path.suffix.lower() in PAIRED else [path]
    return b"".join(name.read_bytes() for name in names if name.is_file())


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]
