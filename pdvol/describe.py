"""A scene as plain JSON: what `run.json` keeps, and what tells whether a stored run is still the same scene."""

import hashlib
import inspect
import math
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np


def describe(thing):
    """Dataclasses, arrays, paths and functions as JSON. Arrays, files and functions become digests of their contents."""
    if is_dataclass(thing) and not isinstance(thing, type):
        own = {"psi": describe(thing.psi)} if getattr(getattr(thing, "psi", None), "__module__", "pdvol").split(".")[0] != "pdvol" else {}
        return {"type": type(thing).__name__, **own, **{f.name: describe(getattr(thing, f.name)) for f in fields(thing)}}
    if isinstance(thing, np.ndarray):
        return {"array": list(thing.shape), "digest": _digest(np.ascontiguousarray(thing).tobytes())}
    if isinstance(thing, (tuple, list)):
        return [describe(item) for item in thing]
    if isinstance(thing, dict):
        return {str(key): describe(value) for key, value in thing.items()}
    if isinstance(thing, (np.integer, np.floating, np.bool_)):
        return describe(thing.item())
    if isinstance(thing, float) and not math.isfinite(thing):
        return None  # as in the JSON it will be compared with, which has no such number
    if thing is None or isinstance(thing, (bool, int, float)):
        return thing
    if isinstance(thing, (str, Path)):
        path = Path(thing)
        if isinstance(thing, Path) or path.suffix:
            return {"file": path.name, "digest": _digest(path.read_bytes())} if path.is_file() else {"file": path.name}
        return thing
    if callable(thing):
        return {"function": getattr(thing, "__qualname__", type(thing).__name__), "digest": _digest(_source(thing).encode())}
    return repr(thing)


def differences(old, new, where: str = "scene") -> list[str]:
    """Where two descriptions differ, as `scene.bodies[0].material.young: 1e5 -> 2e5`."""
    if isinstance(old, dict) and isinstance(new, dict):
        keys = list(dict.fromkeys([*old, *new]))
        return [line for key in keys for line in differences(old.get(key), new.get(key), f"{where}.{key}")]
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return [line for i, pair in enumerate(zip(old, new, strict=True)) for line in differences(*pair, f"{where}[{i}]")]
    return [] if old == new else [f"{where}: {old} -> {new}"]


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _source(function) -> str:
    """A function's text and the numbers it closes over."""
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        text = repr(function)
    cells = [describe(cell.cell_contents) for cell in getattr(function, "__closure__", None) or ()]
    return f"{text}{cells}{describe(getattr(function, '__defaults__', None))}"
