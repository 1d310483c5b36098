"""Switches the extension on and off."""

import bpy

from . import hooks, operators, panel, properties, thumbnails

CLASSES = (*operators.CLASSES, *panel.CLASSES)


def register() -> None:
    """Properties, buttons, panels and what Blender calls by itself."""
    properties.register()
    for kind in CLASSES:
        bpy.utils.register_class(kind)
    hooks.register()


def unregister() -> None:
    """All of it, in the other order."""
    hooks.unregister()
    thumbnails.unregister()
    for kind in reversed(CLASSES):
        bpy.utils.unregister_class(kind)
    properties.unregister()
