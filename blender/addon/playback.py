"""Objects follow a level of a run: Mesh Cache modifiers at the end of their stacks. UVs and materials stay as they are.

A cache fits one number of vertices. Where renders have more than the 3D view, as by a Subdivision modifier, there is
one for each.
"""

from pathlib import Path

import bpy

from ..shot.files import Places, read_pc2
from ..work.play import Played, played_frames, read_objects
from ..work.stored import stored_levels
from .gather import MODIFIERS


def places_of() -> Places:
    """The files of the shot beside the open .blend; it must have been saved."""
    return Places(Path(bpy.data.filepath))


def show(scene: bpy.types.Scene) -> str:
    """Let objects follow the chosen run and level, the finest that is there where it has no such level.

    Returns
    -------
    str
        What does not fit, in a line; empty where all is well.
    """
    if not bpy.data.filepath or scene.pdvol.run == 0:
        return ""
    places, number, level = places_of(), scene.pdvol.run, shown_level(scene)
    if level is None:
        return ""
    folder, played = places.caches(number, level), read_objects(places.play(number))
    wrong = [_follow(scene, thing, folder) for thing in played]
    fits = [_fit(scene, thing, folder) for thing in played]
    return next((line for line in (*wrong, *fits) if line), "")


def shown_level(scene: bpy.types.Scene) -> int | None:
    """The level that objects follow: the chosen one, or the finest that can be shown; None where there is none."""
    places, number = places_of(), scene.pdvol.run
    levels = [level for level in stored_levels(places.run(number)) if played_frames(places, number, level)]
    return min(scene.pdvol.level, max(levels)) if levels else None


def clear(scene: bpy.types.Scene) -> None:
    """Objects follow nothing any more."""
    for thing in scene.objects:
        unlink(thing)


def unlink(thing: bpy.types.Object) -> None:
    """One object follows nothing any more."""
    for name in MODIFIERS:
        if name in thing.modifiers and thing.is_editable:
            thing.modifiers.remove(thing.modifiers[name])


def _follow(scene: bpy.types.Scene, played: Played, folder: Path) -> str:
    thing = scene.objects.get(played.label)
    if thing is None or not thing.is_editable:
        return f"{played.label!r} is gone or was renamed: preview again to see it move"
    for number, name in enumerate(MODIFIERS):
        if number >= played.caches:
            if name in thing.modifiers:
                thing.modifiers.remove(thing.modifiers[name])
            continue
        modifier = thing.modifiers.get(name)
        if modifier is None:
            modifier = thing.modifiers.new(name, "MESH_CACHE")
            modifier.cache_format = "PC2"
            modifier.show_viewport = number == 0
        modifier.show_render = number == played.caches - 1
        modifier.filepath = bpy.path.relpath(str(folder / played.files[number]))  # it may be another one of that name
        modifier.frame_start = scene.frame_start
    thing.update_tag(refresh={"DATA"})
    return ""


def _fit(scene: bpy.types.Scene, played: Played, folder: Path) -> str:
    """A line where an object's mesh has been edited since, so that its cache has other vertices."""
    thing = scene.objects.get(played.label)
    if thing is None:
        return ""
    shown = len(thing.evaluated_get(bpy.context.evaluated_depsgraph_get()).data.vertices)
    points = read_pc2(folder / played.files[0]).shape[1]
    if shown == points:
        return ""
    return f"{played.label!r} has {shown:,} vertices and its cache {points:,}: preview again to see it move"
