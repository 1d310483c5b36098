"""What scenarios of Blender's extension share: things of a scene, buttons, and what the 3D view shows."""

import math
import os
import sys
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import blender
from blender.addon import tasks
from blender.shot.files import Places

G = 9.81
SAFETY = 300.0  # seconds that a task may take


def begin(folder: Path, name: str = "shot", end: int = 9, fps: int = 24) -> bpy.types.Scene:
    """An empty scene of a few frames, saved; the extension is switched on."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if not hasattr(bpy.types.Scene, "pdvol"):
        blender.register()
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.render.fps = 1, end, fps
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / f"{name}.blend"))
    return scene


def cube(name: str = "Cube", size: float = 0.5, at=(0.0, 0.0, 1.0), cuts: int = 0) -> bpy.types.Object:
    """A cube, cut so many times."""
    bpy.ops.mesh.primitive_cube_add(size=size, location=at)
    thing = bpy.context.object
    thing.name = name
    if cuts:
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.mesh.subdivide(number_cuts=cuts)
        bpy.ops.object.mode_set(mode="OBJECT")
    return thing


def part(role: str, *things: bpy.types.Object, vertices: str = "60") -> None:
    """Press Body or Obstacle with these selected."""
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
        thing.pdvol.vertices = vertices
    bpy.context.view_layer.objects.active = things[0]
    assert bpy.ops.pdvol.part(role=role) == {"FINISHED"}


def group(thing: bpy.types.Object, name: str, chosen) -> None:
    """A vertex group of the vertices that a function of their own coordinates chooses."""
    made = thing.vertex_groups.new(name=name)
    made.add([v.index for v in thing.data.vertices if chosen(v.co)], 1.0, "REPLACE")


def keyed(thing: bpy.types.bpy_struct, name: str, values: dict) -> None:
    """Keyframes of a property: its values by frame."""
    for frame, value in values.items():
        setattr(thing, name, value)
        thing.keyframe_insert(name, frame=frame)


def wait() -> str:
    """Until what goes on has ended; its error, empty where there was none."""
    end = time.monotonic() + SAFETY
    while tasks.step(bpy.context):
        assert time.monotonic() < end, tasks.session.message
        time.sleep(0.05)
    return tasks.session.error


def press(button: str) -> str:
    """Press a button and wait; its error, empty where all is well."""
    try:
        assert getattr(bpy.ops.pdvol, button)() == {"FINISHED"}
    except RuntimeError as error:  # what an operator reports is an exception in scripts
        assert tasks.session.error and tasks.session.error in str(error)
        return tasks.session.error
    return wait()


def refuses_as_body(thing: bpy.types.Object, reason: str) -> None:
    """Body is refused in a line for this object."""
    bpy.context.view_layer.objects.active = thing
    thing.select_set(True)
    try:
        bpy.ops.pdvol.part(role="BODY")
    except RuntimeError as error:
        assert reason in str(error)
    else:
        raise AssertionError(f"{thing.name} became a body")


def world(thing: bpy.types.Object, frame: int | None = None) -> np.ndarray:
    """(n, 3) of an object as the 3D view shows it."""
    if frame is not None:
        bpy.context.scene.frame_set(frame)
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    found = np.array([evaluated.matrix_world @ v.co for v in mesh.vertices])
    evaluated.to_mesh_clear()
    return found


def falls(thing: bpy.types.Object, before: np.ndarray, frame: int, metres: float = 1.0) -> None:
    """An object has fallen freely, by now."""
    scene = bpy.context.scene
    seconds = (frame - scene.frame_start) * scene.render.fps_base / scene.render.fps
    fallen = metres * (before[:, 2].mean() - world(thing, frame)[:, 2].mean())
    assert math.isclose(fallen, G / 2 * seconds**2, rel_tol=0.03), (fallen, G / 2 * seconds**2)


def places() -> Places:
    return Places(Path(bpy.data.filepath))


def children() -> list[int]:
    """Processes below this one that still run, whoever their parents were."""
    own, found = os.getpid(), []
    for entry in Path("/proc").iterdir():
        if entry.name.isdecimal() and int(entry.name) != own:
            try:
                variables = (entry / "environ").read_bytes().split(b"\0")
                state = (entry / "stat").read_text().rpartition(")")[2].split()[0]
            except OSError:
                continue
            if f"PDVOL_SCENARIO={own}".encode() in variables and state != "Z":
                found.append(int(entry.name))
    return found


def carry_out(scenarios: dict) -> None:
    """As a program: the scenario of the first word, in the folder of the second."""
    name, folder = sys.argv[1:]
    scenarios[name](Path(folder))
    print(f"{name} holds in Blender {bpy.app.version_string}", flush=True)
    os._exit(0)  # bpy as a module crashes after Python's end where any property has an update function
