"""The contact sheet of a wedge, as an icon of the panel."""

import bpy
import bpy.utils.previews

from . import playback

_previews: dict = {}
"""The collection that Blender keeps pictures of the panel in, under "sheet"."""


def icon() -> int:
    """The number of the sheet's icon; 0 where there is no sheet."""
    if not bpy.data.filepath:
        return 0
    file = playback.places_of().wedge / "sheet.png"
    if not file.is_file():
        return 0
    if "sheet" not in _previews:
        _previews["sheet"] = bpy.utils.previews.new()
    pictures = _previews["sheet"]
    key = f"{file} {file.stat().st_mtime_ns}"  # another sheet in its place is another picture
    if key not in pictures:
        pictures.clear()
        pictures.load(key, str(file), "IMAGE")
    return pictures[key].icon_id


def unregister() -> None:
    """Let go of the picture."""
    for pictures in _previews.values():
        bpy.utils.previews.remove(pictures)
    _previews.clear()
