"""What the buttons do, as plain functions: operators call them, and so do tests. A timer calls `step`."""

import shutil
from collections.abc import Sequence
from dataclasses import dataclass

import bpy

from ..shot.description import ShotError
from ..shot.files import Places
from ..shot.scene_text import open_shapes, write_shot
from ..work import commands
from ..work.play import Played, read_objects, write_objects
from ..work.session import Ended, Session, Task, forget_run
from ..work.stored import findings, is_preview, stored_levels, stored_settings, variations
from . import environment, gather, playback
from .properties import OWN

session = Session()
"""What goes on in this Blender: one task at a time."""
WEDGE_OBJECTS = "wedge_objects"
"""The folder that keeps how objects will follow the variation that is chosen."""


@dataclass(frozen=True)
class Written:
    """A shot whose scene file has been written.

    Attributes
    ----------
    places : its files
    repairs : the command lines that close the shapes of bodies that ask for it
    played : how objects will follow
    """

    places: Places
    repairs: list[list[str]]
    played: list[Played]


def write(context: bpy.types.Context) -> Written:
    """Write the scene file and what it reads; ShotError where the .blend has no file yet, the scene holds no shot, or
    the folder cannot be written.
    """
    places = _saved_places()
    shot, played = gather.gather(context)
    try:
        write_shot(shot, places)
    except OSError as error:
        raise ShotError(f"cannot write {error.filename or places.folder}: {error.strerror}") from error
    repairs = [commands.repair(*shape) for shape in open_shapes(shot, places.meshes)]
    return Written(places, repairs, played)


def check(context: bpy.types.Context) -> None:
    """Write the scene file, and let pdvol look for what would stop a run."""
    written = write(context)
    places = written.places
    places.findings.unlink(missing_ok=True)
    _start(context, Task("Check", [*written.repairs, commands.check(places.scene, places.findings)]), places)


def preview(context: bpy.types.Context) -> None:
    """Write the scene file, and simulate level 0. The preview that was shown goes, if it was not refined."""
    session.cancel()
    written = write(context)
    places, number = written.places, _next_number(written.places)
    words = commands.preview(places.scene, places.run(number))
    task = Task("Preview", [*written.repairs, words], number, context.scene.pdvol.run)
    _begin_run(context, task, written.places, written.played, 0)


def refine(context: bpy.types.Context) -> None:
    """Simulate the finer levels of the run that is shown, up to `refine_to`; goes on where it was stopped before."""
    places, number = _shown_run()
    last = context.scene.pdvol.refine_to
    context.scene.pdvol.level = last
    _start(context, Task("Refine", [commands.refine(places.run(number), last)], number), places)


def resume(context: bpy.types.Context) -> None:
    """Go on with the run that is shown, where it was stopped."""
    places, number = _shown_run()
    run = places.run(number)
    words = commands.resume(places.scene, run, max(stored_levels(run), default=0), stored_settings(run))
    _start(context, Task("Resume", [words], number), places)


def go_on_from_frame(context: bpy.types.Context) -> None:
    """A new run that begins with the states of the one that is shown, up to the current frame, and goes on with the
    scene as it is now.
    """
    scene = context.scene
    places, source = _shown_run()
    frame = scene.frame_current - scene.frame_start
    if frame < 1:
        raise ShotError(f"go to the frame from which on something changes, after frame {scene.frame_start}")
    step = frame * scene.pdvol.steps
    levels = [level for level, last in stored_levels(places.run(source)).items() if last >= step]
    if not levels:
        raise ShotError(f"frame {scene.frame_current} is not computed yet; choose an earlier one")
    session.cancel()
    written = write(context)
    number = _next_number(places)
    words = commands.branch(places.scene, places.run(source), step, places.run(number), max(levels))
    task = Task(f"From frame {scene.frame_current}", [*written.repairs, words], number, source)
    _begin_run(context, task, places, written.played, min(scene.pdvol.level, max(levels)))


def wedge(context: bpy.types.Context) -> None:
    """Write the scene file, and simulate level 0 with evenly spaced values of one number."""
    settings = context.scene.pdvol
    if settings.first == settings.last:
        raise ShotError("From and To are the same: there is nothing to vary")
    session.cancel()
    written = write(context)
    places = written.places
    shutil.rmtree(places.wedge, ignore_errors=True)
    write_objects(places.folder / WEDGE_OBJECTS, written.played)
    words = commands.wedge(places.scene, places.wedge, settings.varied, settings.first, settings.last, settings.count)
    _start(context, Task("Wedge", [*written.repairs, words]), places)


def choose(context: bpy.types.Context) -> None:
    """Make a variation of the wedge the run that is shown, and take its value over."""
    settings, places = context.scene.pdvol, _saved_places()
    there = variations(places.wedge)
    if not there:
        raise ShotError("there is no variation yet: press Wedge")
    number = int(settings.chosen)
    changes = there[number]
    for name, text in changes.items():
        _take_over(context.scene, name, float(text))
    run = _next_number(places)
    task = Task("Choose", [commands.pick(places.wedge, number, places.run(run))], run, settings.run)
    _begin_run(context, task, places, read_objects(places.folder / WEDGE_OBJECTS), 0)


def install(context: bpy.types.Context) -> None:
    """Make a virtual environment of the extension's own, and install pdvol there."""
    folder = environment.own_folder()
    steps = environment.install_commands(folder, environment.preference(context, "source"))
    session.start(Task("Install", steps), Places(folder / "install.blend"), (), 1.0)


def step(context: bpy.types.Context) -> bool:
    """Look at what goes on, and show what is new; whether something still goes on."""
    for event in session.tick():
        if isinstance(event, Ended):
            _end(context.scene, event.task)
        if bpy.data.filepath:
            wrong = playback.show(context.scene)
            session.error = session.error or wrong
    return session.busy


def _end(scene: bpy.types.Scene, task: Task) -> None:
    """What is left to do when a task has ended."""
    if task.title == "Check":
        defects, session.notes = findings(playback.places_of().findings)
        if defects:
            session.error = " ".join(defects[0].split())
            session.message = "Check: not sound"
            session.notes = [*defects[1:], *session.notes]
    if not task.run or not bpy.data.filepath:
        return
    places = playback.places_of()
    if not stored_levels(places.run(task.run)):  # it ended before its first step
        forget_run(places, task.run)
        if scene.pdvol.run == task.run:
            scene.pdvol.run = task.before
    elif task.title == "Preview" and is_preview(places.run(task.before)):
        forget_run(places, task.before)


def _start(context: bpy.types.Context, task: Task, places: Places) -> None:
    session.start(task, places, environment.pdvol_words(context), gather.frame_rate(context.scene))


def _saved_places() -> Places:
    if not bpy.data.filepath:
        raise ShotError("save the .blend first: its runs lie beside it")
    return playback.places_of()


def _shown_run() -> tuple[Places, int]:
    places, number = _saved_places(), bpy.context.scene.pdvol.run
    if not number or not stored_levels(places.run(number)):
        raise ShotError("there is no run yet: press Preview")
    return places, number


def _next_number(places: Places) -> int:
    return max(places.run_numbers(), default=0) + 1


def _begin_run(context: bpy.types.Context, task: Task, places: Places, played: Sequence[Played], level: int) -> None:
    """Begin a task that makes a new run, and show that from now on."""
    write_objects(places.play(task.run), played)
    context.scene.pdvol.level, context.scene.pdvol.run = level, task.run
    _start(context, task, places)


def _take_over(scene: bpy.types.Scene, parameter: str, value: float) -> None:
    """Set what a parameter of the scene file stands for."""
    thing = gather.body_of(scene, parameter)
    if thing is None:
        scene.pdvol.friction = value
    elif parameter.endswith("_young"):
        thing.pdvol.preset, thing.pdvol.young = OWN, value
    else:
        thing.pdvol.velocity["xyz".index(parameter[-1])] = value
