"""The panel in the sidebar of the 3D view, and the preferences."""

import bpy
from bpy.props import StringProperty

from ..work.stored import stored_levels
from . import playback, tasks, thumbnails
from .environment import PACKAGE
from .properties import OWN


class _Panel:
    bl_space_type, bl_region_type, bl_category = "VIEW_3D", "UI", "pdvol"


class PDVOL_PT_object(_Panel, bpy.types.Panel):
    """The active object's part."""

    bl_label, bl_idname = "Object", "PDVOL_PT_object"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw it."""
        layout, thing = self.layout, context.object
        row = layout.row(align=True)
        for role, name in (("BODY", "Body"), ("OBSTACLE", "Obstacle"), ("NONE", "Neither")):
            pressed = thing is not None and thing.pdvol.role == role
            row.operator("pdvol.part", text=name, depress=pressed).role = role
        if thing is None or thing.pdvol.role != "BODY":
            return
        settings = thing.pdvol
        layout.use_property_split = True
        draw_material(layout, settings)
        layout.prop(settings, "vertices")
        layout.prop(settings, "velocity")
        layout.prop_search(settings, "pins", thing, "vertex_groups")
        if settings.pins:
            layout.prop(settings, "reach")
        layout.prop(settings, "pull")
        if settings.pull is not None:
            layout.prop(settings, "pull_frames")
        layout.prop(settings, "repair")
        if settings.repair:
            layout.prop(settings, "hole")
        for number, region in enumerate(settings.regions):
            box = layout.box()
            row = box.row(align=True)
            row.prop_search(region, "group", thing, "vertex_groups", text="Region")
            row.operator("pdvol.region", text="", icon="X").remove = number
            draw_material(box, region)
        layout.operator("pdvol.region", text="Add Region").remove = -1


def draw_material(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """A preset, and its numbers where they are one's own."""
    layout.prop(settings, "preset")
    if settings.preset == OWN:
        for name in ("young", "poisson", "density", "damping"):
            layout.prop(settings, name)


class PDVOL_PT_shot(_Panel, bpy.types.Panel):
    """The shot and its buttons."""

    bl_label, bl_idname = "Shot", "PDVOL_PT_shot"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw it."""
        layout, settings, session = self.layout, context.scene.pdvol, tasks.session
        column = layout.column()
        column.use_property_split = True
        column.prop(settings, "ground")
        if settings.ground:
            column.prop(settings, "height")
        column.prop(settings, "friction")
        column.prop(settings, "steps")
        row = layout.row(align=True)
        row.operator("pdvol.check")
        row.operator("pdvol.preview")
        row = layout.row(align=True)
        row.operator("pdvol.refine")
        row.prop(settings, "refine_to")
        row = layout.row(align=True)
        row.operator("pdvol.resume")
        row.operator("pdvol.go_on_from_frame")
        if session.busy:
            row = layout.row(align=True)
            row.progress(text=session.message, factor=session.fraction())
            row.operator("pdvol.cancel", text="", icon="X")
        elif session.message:
            layout.label(text=session.message)
        if session.error:
            box = layout.box()
            for line in wrapped(session.error, context.region.width // 7):
                box.label(text=line)
        for note in session.notes:
            for line in wrapped(note, context.region.width // 7):
                layout.label(text=line)
        self._draw_levels(context)

    def _draw_levels(self, context: bpy.types.Context) -> None:
        settings = context.scene.pdvol
        if not bpy.data.filepath or not settings.run:
            return
        reached = stored_levels(playback.places_of().run(settings.run))
        if reached:
            row = self.layout.row(align=True)
            row.prop(settings, "run")
            row.prop(settings, "level")
            row.operator("pdvol.clear", text="", icon="UNLINKED")
            shown = playback.shown_level(context.scene)
            ends = "" if shown is None else f"; level {shown} is shown"
            self.layout.label(text=f"Levels 0 to {max(reached)} are stored{ends}")


class PDVOL_PT_wedge(_Panel, bpy.types.Panel):
    """Many variations of level 0."""

    bl_label, bl_idname, bl_options = "Wedge", "PDVOL_PT_wedge", {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw it."""
        layout, settings = self.layout, context.scene.pdvol
        layout.prop(settings, "varied")
        row = layout.row(align=True)
        for name in ("first", "last", "count"):
            row.prop(settings, name)
        layout.operator("pdvol.wedge")
        if thumbnails.items():
            layout.template_icon_view(settings, "chosen", show_labels=True, scale=8.0, scale_popup=6.0)
            layout.prop(settings, "chosen", text="")
            layout.operator("pdvol.choose")


def wrapped(text: str, width: int) -> list[str]:
    """A line as several that fit the panel."""
    import textwrap

    return textwrap.wrap(text, max(width, 20))


class PDVOL_Preferences(bpy.types.AddonPreferences):
    """Where pdvol is."""

    bl_idname = PACKAGE
    command: StringProperty(
        name="Command", description="The words that start pdvol, as /opt/pdvol/run pdvol; its own where empty"
    )
    source: StringProperty(
        name="Install from",
        description="A wheel, or a checkout as /home/me/pdvol[solver]; the extension's own wheel where empty",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw them."""
        self.layout.prop(self, "command")
        self.layout.prop(self, "source")
        self.layout.operator("pdvol.install")
        if tasks.session.message:
            self.layout.label(text=tasks.session.message)


CLASSES = (PDVOL_PT_object, PDVOL_PT_shot, PDVOL_PT_wedge, PDVOL_Preferences)
