"""What Blender calls by itself: a timer while something goes on, and what must end with the open file."""

import atexit

import bpy

from . import playback, tasks

EVERY = 0.5  # seconds between two looks at what goes on


def begin_timer() -> None:
    """Look after the session until nothing goes on."""
    if not bpy.app.timers.is_registered(_look):
        bpy.app.timers.register(_look, first_interval=EVERY)


def _look() -> float | None:
    if bpy.app.is_job_running("RENDER"):  # it reads the objects from a thread of its own
        return EVERY
    goes_on = tasks.step(bpy.context)
    _show_status()
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()
    return EVERY if goes_on else None


def status() -> str | None:
    """What goes on, for the status bar; None where nothing does, so that Blender's own text is shown."""
    session = tasks.session
    if session.task is None:
        return None
    return f"pdvol: {session.message}" + (" (Esc stops it)" if session.task.title == "Check" else "")


def _show_status() -> None:
    for window in bpy.context.window_manager.windows:
        window.workspace.status_text_set(status())


@bpy.app.handlers.persistent
def _before_load(*_arguments: object) -> None:
    """Another file is opened: what goes on belongs to the one before."""
    tasks.session.cancel()
    tasks.session.message = tasks.session.error = ""


@bpy.app.handlers.persistent
def _after_load(*_arguments: object) -> None:
    """The opened file's run is shown as far as it has got."""
    playback.show(bpy.context.scene)


def register() -> None:
    """From now on Blender calls these."""
    bpy.app.handlers.load_pre.append(_before_load)
    bpy.app.handlers.load_post.append(_after_load)
    atexit.register(tasks.session.cancel)


def unregister() -> None:
    """It calls them no more; what goes on ends."""
    tasks.session.cancel()
    _show_status()
    atexit.unregister(tasks.session.cancel)
    bpy.app.handlers.load_post.remove(_after_load)
    bpy.app.handlers.load_pre.remove(_before_load)
    if bpy.app.timers.is_registered(_look):
        bpy.app.timers.unregister(_look)
