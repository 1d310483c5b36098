"""The buttons."""

from collections.abc import Callable

import bpy
from bpy.props import EnumProperty, IntProperty

from ..shot.description import ShotError
from . import hooks, playback, tasks
from .properties import ROLES


def _do(operator: bpy.types.Operator, function: Callable, *arguments: object) -> set[str]:
    """Call a function; a mistake of the user becomes one line."""
    try:
        function(*arguments)
    except ShotError as error:
        tasks.session.error = str(error)
        operator.report({"ERROR"}, str(error))
        return {"CANCELLED"}
    return {"FINISHED"}


class PDVOL_OT_part(bpy.types.Operator):
    """Make the selected meshes bodies or obstacles, or take them out of the shot"""

    bl_idname, bl_label, bl_options = "pdvol.part", "Set Part", {"REGISTER", "UNDO"}
    role: EnumProperty(items=ROLES)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Set the part of each selected object."""
        return _do(self, self._set, context)

    def _set(self, context: bpy.types.Context) -> None:
        if not context.selected_objects:
            raise ShotError("nothing is selected: select meshes first")
        for thing in context.selected_objects:
            _require_part(thing, self.role)
        for thing in context.selected_objects:
            thing.pdvol.role = self.role
            if self.role != "BODY":
                playback.unlink(thing)


def _require_part(thing: bpy.types.Object, role: str) -> None:
    if thing.instance_type == "COLLECTION" and thing.instance_collection is not None:
        raise ShotError(f"{thing.name!r} is an instance: make it real first (Object > Apply > Make Instances Real)")
    if thing.type != "MESH":
        raise ShotError(f"{thing.name!r} is no mesh: convert it first (Object > Convert > Mesh)")
    if not thing.is_editable:
        raise ShotError(
            f"{thing.name!r} is linked from another file: make a library override first (Object > Library Override)"
        )


class PDVOL_OT_region(bpy.types.Operator):
    """Add a part of the body that is made of something else, or remove one"""

    bl_idname, bl_label, bl_options = "pdvol.region", "Region", {"REGISTER", "UNDO"}
    remove: IntProperty(default=-1)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add a region where `remove` is negative, else remove that one."""
        regions = context.object.pdvol.regions
        if self.remove >= 0:
            regions.remove(self.remove)
        else:
            regions.add().preset = "RUBBER"
        return {"FINISHED"}


class _Task:
    """A button that sets off a task; `function` is one of `tasks`."""

    bl_options = {"REGISTER"}
    function = ""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only one task goes on at a time."""
        return not tasks.session.busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Begin, and look after it from now on."""
        ended = _do(self, getattr(tasks, self.function), context)
        hooks.begin_timer()
        return ended


class PDVOL_OT_check(_Task, bpy.types.Operator):
    """Write the scene file, and look for what would stop or spoil a run; Esc stops it"""

    bl_idname, bl_label, function = "pdvol.check", "Check", "check"

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Begin, and wait for Esc."""
        ended = self.execute(context)
        if ended != {"FINISHED"}:
            return ended
        self.task = tasks.session.task
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Cancel by Esc; all other events go on to Blender."""
        if tasks.session.task is not self.task:
            return {"FINISHED"}
        if event.type != "ESC":
            return {"PASS_THROUGH"}
        tasks.session.cancel()
        return {"CANCELLED"}


def _task(name: str, label: str, text: str) -> type:
    parts = {"__doc__": text, "bl_idname": f"pdvol.{name}", "bl_label": label, "function": name}
    return type(f"PDVOL_OT_{name}", (_Task, bpy.types.Operator), parts)


class PDVOL_OT_cancel(bpy.types.Operator):
    """End what goes on; what is stored is kept"""

    bl_idname, bl_label = "pdvol.cancel", "Cancel"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Cancel."""
        tasks.session.cancel()
        playback.show(context.scene)
        return {"FINISHED"}


class PDVOL_OT_clear(bpy.types.Operator):
    """Let objects stand where they are without the simulation; runs are kept"""

    bl_idname, bl_label, bl_options = "pdvol.clear", "Unlink", {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove the caches' modifiers."""
        playback.clear(context.scene)
        context.scene.pdvol.run = 0
        return {"FINISHED"}


CLASSES = (
    PDVOL_OT_part,
    PDVOL_OT_region,
    PDVOL_OT_check,
    _task("preview", "Preview", "Write the scene file, and simulate level 0"),
    _task("refine", "Refine", "Simulate finer levels of the run that is shown: the same motion with more detail"),
    _task("resume", "Resume", "Go on with the run that is shown, where it was stopped"),
    _task("go_on_from_frame", "Go On from Here", "Keep the run up to this frame, and simulate the rest anew"),
    _task("wedge", "Wedge", "Simulate level 0 with evenly spaced values of one number"),
    _task("choose", "Choose", "Show this variation, and take its value over"),
    _task("install", "Install pdvol", "Install pdvol into a virtual environment of this extension; needs the net"),
    PDVOL_OT_cancel,
    PDVOL_OT_clear,
)
