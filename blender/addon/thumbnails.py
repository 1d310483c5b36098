"""The variations of a wedge, as pictures to choose from."""

from pathlib import Path

import bpy
import bpy.utils.previews

from ..work.stored import variations
from . import playback

_pictures: dict = {}
"""Blender's collection of pictures, under "tiles"; it is made with the first one."""
_kept: dict[str, list] = {"": []}
"""The items by the state of the wedge's file: Blender keeps no reference to those of a list that changes."""


def items() -> list:
    """The variations as items of an enumeration, with their values and pictures; empty where there is no wedge."""
    if not bpy.data.filepath:
        return _kept[""]
    wedge = playback.places_of().wedge
    try:
        state = f"{wedge} {(wedge / 'wedge.json').stat().st_mtime_ns}"
    except OSError:
        return _kept[""]
    if state not in _kept:
        unregister()
        _pictures["tiles"] = bpy.utils.previews.new()
        _kept[state] = [_item(wedge, number, changes) for number, changes in sorted(variations(wedge).items())]
    return _kept[state]


def pictures() -> list:
    """Those of the last items, in their order."""
    return list(_pictures["tiles"].values()) if _pictures else []


def unregister() -> None:
    """Let go of the pictures."""
    for pictures in _pictures.values():
        bpy.utils.previews.remove(pictures)
    _pictures.clear()
    for state in [state for state in _kept if state]:
        del _kept[state]


def _item(wedge: Path, number: int, changes: dict[str, str]) -> tuple:
    file = wedge / "tiles" / f"{number}.png"
    icon = _pictures["tiles"].load(str(file), str(file), "IMAGE").icon_id if file.is_file() else 0
    values = ", ".join(f"{float(value):.4g}" for value in changes.values())
    return str(number), f"{number}: {values}", ", ".join(f"{k} = {v}" for k, v in changes.items()), icon, number
