"""Scenarios of Blender's extension: a program for a Python that has the package bpy, apart from pdvol's environment.

    python in_extension.py SCENARIO FOLDER

PDVOL_COMMAND has the words that start pdvol. A scenario asserts what it promises; the exit status is 0 where it holds.
"""

import json
import math
import os
import shlex
import subprocess
import sys
import time
import zipfile
from pathlib import Path
from types import SimpleNamespace

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import blender
from blender.addon import environment, panel, playback, tasks, thumbnails
from blender.shot.files import Places, read_pc2
from blender.work.session import Task
from blender.work.stored import stored_levels

G = 9.81
SAFETY = 300.0  # seconds that a task may take


# ---- what scenarios share


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


# ---- scenarios


def falls_and_is_refined(folder: Path) -> None:
    """A preview, and a refinement; the shown level is switched on one timeline."""
    scene = begin(folder, end=13)
    thing = cube("Box", cuts=1)
    part("BODY", thing, vertices="60 200")
    before = world(thing)
    assert press("preview") == "" and scene.pdvol.run == 1
    falls(thing, before, 8)
    level_0 = world(thing, 13)
    assert level_0[:, 2].min() > -0.02  # the ground
    assert press("refine") == "" and scene.pdvol.level == 1
    level_1 = world(thing, 13)
    assert 1e-5 < np.abs(level_1 - level_0).max() < 0.1
    scene.pdvol.level = 0
    assert np.abs(world(thing) - level_0).max() < 1e-6
    scene.pdvol.level = 1
    assert np.abs(world(thing) - level_1).max() < 1e-6
    assert np.abs(world(thing, 1) - before).max() < 1e-5  # at rest at the first frame, and before it
    assert stored_levels(places().run(1)) == {0: 24, 1: 24}


def the_command_line_gives_the_same_states(folder: Path) -> None:
    """The scene file is run without Blender, in another place."""
    begin(folder, "my shot")
    a, b = cube("A", cuts=1, at=(0, 0, 0.4)), cube("B", at=(0.1, 0, 1.0))
    part("BODY", a, b, vertices="60 120")
    a.pdvol.preset = "SPONGE"
    assert press("preview") == "" and press("refine") == ""
    words = [
        *shlex.split(os.environ["PDVOL_COMMAND"]),
        "run",
        "my shot.py",
        "-o",
        "by hand",
        "--no-picture",
        "--no-xdmf",
    ]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    for level in ("0", "1"):
        one, other = (run / "levels" / level / "states.bin" for run in (places().run(1), folder / "by hand"))
        assert one.read_bytes() == other.read_bytes(), level


def pins_hold(folder: Path) -> None:
    """A bar is held at one end by a vertex group, and hangs."""
    scene = begin(folder, end=13)
    scene.pdvol.ground = False
    thing = cube("bar", size=1.0, cuts=3)
    thing.scale = (1.0, 0.2, 0.2)
    group(thing, "held end", lambda co: co.x < -0.49)
    part("BODY", thing, vertices="100 250")
    thing.pdvol.pins = "held end"
    before = world(thing)
    assert press("preview") == "" and press("refine") == ""
    for level in (0, 1):
        scene.pdvol.level = level
        after = world(thing, 13)
        held, free = before[:, 0] < -0.49, before[:, 0] > 0.49
        assert np.abs(after - before)[held].max() < 0.02 and (before - after)[free, 2].mean() > 0.05


def pins_follow_the_objects_animation(folder: Path) -> None:
    """The object itself is keyframed: what is pinned goes with it, also where it is shown."""
    scene = begin(folder, end=13)
    scene.use_gravity = False
    thing = cube("bar", size=1.0, cuts=3, at=(0.0, 0.0, 2.0))
    group(thing, "top", lambda co: co.z > 0.49)
    part("BODY", thing, vertices="100")
    thing.pdvol.pins, thing.pdvol.preset = "top", "RUBBER"
    thing.keyframe_insert("location", frame=1)
    thing.location.x = 0.5
    thing.keyframe_insert("location", frame=13)
    top = world(thing, 1)[:, 2] > 2.49
    before = world(thing, 1)[top]
    assert press("preview") == ""
    for frame in (1, 4, 7, 13):
        moved = world(thing, frame)[top] - before
        assert np.abs(moved - [thing.location.x, 0.0, 0.0]).max() < 0.01, frame  # where its keyframes have it
    assert math.isclose(thing.location.x, 0.5, abs_tol=1e-6)
    assert places().meshes.joinpath("bar.pc2").exists()


def an_animated_collider_pushes(folder: Path) -> None:
    """A keyframed plate and one that is deformed by shape keys meet two bodies in mid air."""
    scene = begin(folder, end=13)
    scene.use_gravity, scene.pdvol.ground, scene.pdvol.friction = False, False, 0.0
    left, right = cube("left", at=(-1, 0, 1)), cube("right", at=(1, 0, 1))
    part("BODY", left, right)
    plates = [cube("plate", size=1.0, at=(-1, 0, 0.6)), cube("bulge", size=1.0, at=(1, 0, 0.6))]
    for plate in plates:
        plate.scale = (0.8, 0.8, 0.1)
    plates[0].keyframe_insert("location", frame=1)
    plates[0].location.z = 0.9
    plates[0].keyframe_insert("location", frame=13)
    plates[1].shape_key_add(name="Basis")
    key = plates[1].shape_key_add(name="up")
    for point in key.data:
        point.co.z += 3.0 if point.co.z > 0 else 0.0  # 0.3 m
    key.value = 0.0
    key.keyframe_insert("value", frame=1)
    key.value = 1.0
    key.keyframe_insert("value", frame=13)
    part("OBSTACLE", *plates)
    starts = [world(thing, 1) for thing in (left, right)]
    assert press("preview") == ""
    for thing, start, plate in zip((left, right), starts, plates, strict=True):
        assert world(thing, 13)[:, 2].min() > world(plate, 13)[:, 2].max() - 0.01  # never through
        assert world(thing, 13)[:, 2].mean() > start[:, 2].mean() + 0.08


def an_armature_moves_a_collider(folder: Path) -> None:
    """A plate that hangs on a bone which turns, with an open sheet beside it."""
    scene = begin(folder, end=9)
    body = cube("soft", at=(0, 0, 1))
    part("BODY", body)
    bpy.ops.object.armature_add(location=(0, 0, 0.3))
    rig = bpy.context.object
    plate = cube("paddle", size=1.0, at=(0, 0, 0.5), cuts=2)
    plate.scale = (1.0, 1.0, 0.1)
    modifier = plate.modifiers.new("Armature", "ARMATURE")
    modifier.object = rig
    group(plate, "Bone", lambda co: True)
    bone = rig.pose.bones[0]
    bone.keyframe_insert("location", frame=1)
    bone.location.y = 0.2  # along the bone, which is upward
    bone.keyframe_insert("location", frame=9)
    bpy.ops.mesh.primitive_plane_add(size=4.0, location=(0, 0, 0.05))
    sheet = bpy.context.object
    part("OBSTACLE", plate, sheet)
    scene.pdvol.ground = False
    rise = world(plate, 9)[:, 2].max() - world(plate, 1)[:, 2].max()
    assert math.isclose(rise, 0.2, abs_tol=0.01)
    assert press("preview") == ""
    text = places().scene.read_text()
    assert "Deforming(PointCache" in text and 'name="Plane", closed=False' in text
    assert world(body, 9)[:, 2].min() > world(plate, 9)[:, 2].max() - 0.01


def two_materials_in_one_body(folder: Path) -> None:
    """A bar whose free half is rubber bends where it is jelly."""
    scene = begin(folder, end=13)
    scene.pdvol.ground = False
    bars = [cube(name, size=1.0, cuts=3, at=(0, y, 1)) for name, y in (("plain", 0.0), ("mixed", 1.0))]
    for thing in bars:
        thing.scale = (1.0, 0.2, 0.2)
        group(thing, "held", lambda co: co.x < -0.49)
        group(thing, "stiff", lambda co: co.x < 0.3)
    part("BODY", *bars, vertices="120")
    for thing in bars:
        thing.pdvol.pins = "held"
    bpy.context.view_layer.objects.active = bars[1]
    assert bpy.ops.pdvol.region(remove=-1) == {"FINISHED"}
    bars[1].pdvol.regions[0].group = "stiff"
    before = [world(thing) for thing in bars]
    assert press("preview") == ""
    sunk = [(b - world(thing, 13))[b[:, 0] > 0.49, 2].mean() for thing, b in zip(bars, before, strict=True)]
    assert sunk[1] < 0.5 * sunk[0], sunk
    assert places().scene.read_text().count("Region(NeoHookean(1000000.0") == 1


def a_body_that_cannot_be_meshed_is_one_line_and_can_be_closed(folder: Path) -> None:
    """A cube without a lid is refused by name; its closed copy falls, and the open one is drawn."""
    begin(folder)
    thing = cube("open box", cuts=1)
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    bpy.ops.object.mode_set(mode="OBJECT")
    for face in thing.data.polygons:
        face.select = face.center.z > 0.24
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.delete(type="FACE")
    bpy.ops.object.mode_set(mode="OBJECT")
    part("BODY", thing)
    error = press("preview")
    assert "open_box" in error and "open" in error and "\n" not in error, error
    assert "open_box" in press("check") and tasks.session.message == "Check: not sound"
    thing.pdvol.repair = True
    before = world(thing)
    assert press("preview") == ""
    falls(thing, before, 8)
    assert len(world(thing)) == len(thing.data.vertices)


def non_manifold_input_is_refused(folder: Path) -> None:
    """Two cubes that share an edge, a single face, and a mesh without faces."""
    begin(folder)
    mesh = bpy.data.meshes.new("fins")
    corners = [(0, 0, 1), (0, 0, 1.5), (1, 0, 1), (-1, 1, 1), (-1, -1, 1)]
    mesh.from_pydata(corners, [], [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    fins = bpy.data.objects.new("fins", mesh)
    bpy.context.collection.objects.link(fins)
    part("BODY", fins)
    error = press("check")
    assert "fins" in error and "\n" not in error, error
    fins.data = bpy.data.meshes.new("nothing")
    assert press("preview") == "'fins' has no faces: it cannot take part"


def cancel_leaves_nothing_behind_and_resume_goes_on(folder: Path) -> None:
    """A preview is cancelled in the middle. What is stored is shown, and gone on with to the same end."""
    os.environ["PDVOL_SCENARIO"] = str(os.getpid())
    scene = begin(folder, end=100)
    thing = cube(cuts=2)
    part("BODY", thing, vertices="300")
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    end = time.monotonic() + SAFETY
    while tasks.session.progress is None or tasks.session.progress.reached.get(0, 0) < 5:
        assert tasks.step(bpy.context) and time.monotonic() < end
        time.sleep(0.02)
    assert children() and not bpy.ops.pdvol.preview.poll()
    assert bpy.ops.pdvol.cancel() == {"FINISHED"}
    assert children() == [] and tasks.session.message == "Preview: cancelled"
    reached = stored_levels(places().run(1))[0]
    assert 5 <= reached < 198
    assert press("resume") == "" and stored_levels(places().run(1))[0] == 198
    assert scene.pdvol.run == 1 and len(read_pc2(places().caches(1, 0) / "Cube.pc2")) == 100


def frames_arrive_while_it_runs(folder: Path) -> None:
    """The timeline can be looked at before a level is done, as far as it has got."""
    begin(folder, end=240)
    thing = cube(cuts=2)
    part("BODY", thing, vertices="200")
    before = world(thing)
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    end = time.monotonic() + SAFETY
    early = 0
    while tasks.step(bpy.context):
        assert time.monotonic() < end
        cache = places().caches(1, 0) / "Cube.pc2"
        if not early and cache.exists():
            early = len(read_pc2(cache))
            if early > 5:
                falls(thing, before, 5)
        time.sleep(0.05)
    assert tasks.session.error == "" and 1 < early < 240, early
    assert len(read_pc2(places().caches(1, 0) / "Cube.pc2")) == 240


def a_file_is_opened_again(folder: Path) -> None:
    """Saved, closed and opened: the same motion, the same settings, and the run can be refined."""
    scene = begin(folder)
    thing = cube("Box 1", cuts=1)
    part("BODY", thing, vertices="60 150")
    thing.pdvol.preset = "MEAT"
    assert press("preview") == ""
    shown = world(thing, 8)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert "Box 1" not in bpy.data.objects
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    thing, scene = bpy.data.objects["Box 1"], bpy.context.scene
    assert np.array_equal(world(thing, 8), shown) and thing.pdvol.preset == "MEAT" and scene.pdvol.run == 1
    assert press("refine") == "" and scene.pdvol.level == 1
    assert np.abs(world(thing, 8) - shown).max() < 0.05
    bpy.ops.wm.save_mainfile()
    last = world(thing, 8)
    there = folder / "moved"
    there.mkdir()
    for name in ("shot.blend", "shot.py", "shot_pdvol"):
        (folder / name).rename(there / name)
    bpy.ops.wm.open_mainfile(filepath=str(there / "shot.blend"))
    assert np.array_equal(world(bpy.data.objects["Box 1"], 8), last)  # all of it may move


def another_file_ends_what_goes_on(folder: Path) -> None:
    """A new file is opened while a preview runs."""
    os.environ["PDVOL_SCENARIO"] = str(os.getpid())
    begin(folder, end=240)
    part("BODY", cube(cuts=2), vertices="300")
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    for _ in range(20):
        tasks.step(bpy.context)
        time.sleep(0.05)
    assert children()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert children() == [] and not tasks.session.busy
    begin(folder, "second", end=240)
    part("BODY", cube(cuts=2), vertices="300")
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    blender.unregister()
    assert children() == []


def undo_takes_back_what_was_set(folder: Path) -> None:
    """Undo goes behind a button; runs are kept, and a preview that goes on is not disturbed."""
    scene = begin(folder, end=13)
    thing = cube("Box", cuts=1)
    bpy.ops.ed.undo_push(message="before")
    part("BODY", thing)
    bpy.ops.ed.undo_push(message="body")
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    bpy.data.objects["Box"].location.x = 3.0
    bpy.ops.ed.undo_push(message="moved")
    bpy.ops.ed.undo()  # while it runs: objects are others now
    scene, thing = bpy.context.scene, bpy.data.objects["Box"]
    assert thing.location.x == 0.0 and thing.pdvol.role == "BODY"
    assert wait() == ""
    scene.pdvol.run = 1  # undo went behind the button that set it
    assert world(thing, 13)[:, 2].mean() < 0.9
    bpy.ops.ed.undo()
    assert bpy.data.objects["Box"].pdvol.role == "NONE"
    assert press("preview").startswith("there is no soft body") and stored_levels(places().run(1)) == {0: 24}


def scale_and_axes(folder: Path) -> None:
    """Centimetres as units, and an object that is turned, scaled unevenly, mirrored and hangs on a parent."""
    scene = begin(folder)
    scene.unit_settings.system, scene.unit_settings.scale_length = "METRIC", 0.01
    bpy.ops.object.empty_add(location=(30, 0, 0))
    parent = bpy.context.object
    parent.rotation_euler = (0.0, 0.0, 0.7)
    thing = cube("Box", size=1.0, at=(0, 0, 150), cuts=1)
    thing.parent = parent
    thing.scale, thing.rotation_euler = (-40.0, 30.0, 20.0), (0.4, 0.2, 0.1)
    part("BODY", thing)
    before = world(thing)
    size = np.linalg.norm(np.ptp(before, axis=0))
    assert press("preview") == ""
    falls(thing, before, 8, metres=0.01)
    after = world(thing, 8)
    assert np.abs(np.ptp(after, axis=0) - np.ptp(before, axis=0)).max() < 0.02 * size  # it flies, as it is
    points = np.loadtxt(
        [line[2:] for line in places().meshes.joinpath("Box.obj").read_text().splitlines() if line[0] == "v"]
    )
    assert np.abs(points - 0.01 * before).max() < 1e-6


def frames_and_rate_are_the_scenes(folder: Path) -> None:
    """Frames 10 to 20, 30000/1001 a second, three steps each."""
    scene = begin(folder)
    scene.frame_start, scene.frame_end, scene.render.fps, scene.render.fps_base = 10, 20, 30, 1.001
    scene.pdvol.steps = 3
    thing = cube("Box", cuts=1, at=(0, 0, 3))
    part("BODY", thing)
    scene.frame_set(14)
    before = world(thing)
    assert press("preview") == "" and scene.frame_current == 14
    falls(thing, before, 18)
    assert stored_levels(places().run(1)) == {0: 30}
    assert np.abs(world(thing, 5) - before).max() < 1e-5  # before its first frame it rests


def no_gravity_and_a_thrown_body(folder: Path) -> None:
    """The scene's gravity may be off; a velocity is a body's own, in metres a second."""
    scene = begin(folder)
    scene.use_gravity = False
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    thing.pdvol.velocity = (1.0, 2.0, 0.0)
    before = world(thing)
    assert press("preview") == ""
    assert np.abs(world(thing, 9) - before - np.array([1.0, 2.0, 0.0]) * 8 / 24).max() < 1e-3


def instances_and_shared_meshes(folder: Path) -> None:
    """An instance of a collection is refused in a line; two objects with one mesh move each by itself."""
    begin(folder)
    inside = bpy.data.collections.new("inside")
    bpy.context.scene.collection.children.link(inside)
    bpy.ops.object.collection_instance_add(collection="inside")
    instance = bpy.context.object
    instance.select_set(True)
    try:
        bpy.ops.pdvol.part(role="BODY")
        raise AssertionError("an instance became a body")
    except RuntimeError as error:
        assert "is an instance: make it real first" in str(error)
    bpy.data.objects.remove(instance)
    one = cube("one", cuts=1)
    two = one.copy()
    two.name, two.location = "two", (1.0, 0.0, 3.0)
    bpy.context.collection.objects.link(two)
    assert one.data == two.data
    part("BODY", one, two)
    before = [world(one), world(two)]
    assert press("preview") == ""
    for thing, start in zip((one, two), before, strict=True):
        falls(thing, start, 8)
    assert np.abs(np.array([v.co for v in one.data.vertices])).max() <= 0.2501  # the mesh itself is as it was


def linked_objects(folder: Path) -> None:
    """An object of another file is refused as a body in a line; as a library override it falls."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    cube("from afar", cuts=1)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    begin(folder)
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (there, here):
        here.objects = list(there.objects)
    (linked,) = here.objects
    bpy.context.collection.objects.link(linked)
    bpy.context.view_layer.objects.active = linked
    linked.select_set(True)
    try:
        bpy.ops.pdvol.part(role="BODY")
        raise AssertionError("a linked object became a body")
    except RuntimeError as error:
        assert "make a library override first" in str(error)
    own = linked.override_create(remap_local_usages=True)
    assert own.library is None and own.data.library is not None
    part("BODY", own)
    before = world(own)
    assert press("preview") == ""
    falls(own, before, 8)
    bpy.ops.wm.save_mainfile()
    shown = world(own, 8)
    bpy.ops.wm.open_mainfile(filepath=str(folder / "shot.blend"))
    own = bpy.data.objects["from afar"]
    assert np.abs(world(own, 8) - shown).max() < 1e-5
    # 5.0.1 forgets add-ons' groups of properties of overrides ("RNA_property_pointer_set: expected ID type").
    assert own.pdvol.role == "BODY" or bpy.app.version >= (5, 0)


def names_of_all_kinds(folder: Path) -> None:
    """Spaces, other alphabets, quotes, slashes; names that differ in nothing that files keep; a .blend of that kind."""
    begin(folder, "mein 'Schuß' 1")
    names = ["Würfel 1", "Würfel_1", "a/b", 'say "x"', "body", "Scene", "class", "ground", "x" * 63]
    things = [cube(name, size=0.2, at=(0.5 * i, 0, 1)) for i, name in enumerate(names)]
    assert [t.name for t in things] == names
    part("BODY", *things, vertices="30")
    things[0].pdvol.pins = ""
    before = [world(thing) for thing in things]
    assert press("preview") == ""
    for thing, start in zip(things, before, strict=True):
        falls(thing, start, 8)


def subdivision_keeps_its_levels(folder: Path) -> None:
    """The 3D view and renders have other numbers of vertices: both move, and both stay above the ground."""
    scene = begin(folder, end=13)
    thing = cube("Box", at=(0, 0, 0.4))
    modifier = thing.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 1, 3
    part("BODY", thing)
    assert press("preview") == ""
    assert (modifier.levels, modifier.render_levels, modifier.show_viewport) == (1, 3, True)
    assert [m.name for m in thing.modifiers] == ["Subdivision", "pdvol", "pdvol render"]
    shown = world(thing, 13)
    assert len(shown) == 26 and -0.03 < shown[:, 2].min() < 0.05
    modifier.levels = 3
    thing.modifiers["pdvol"].show_viewport, thing.modifiers["pdvol render"].show_viewport = False, True
    rendered = world(thing, 13)
    assert len(rendered) == 386 and -0.03 < rendered[:, 2].min() < 0.05
    assert abs(shown[:, 2].mean() - rendered[:, 2].mean()) < 0.03
    assert scene.pdvol.run == 1


def uvs_and_materials_stay(folder: Path) -> None:
    """What is drawn is Blender's own mesh: UVs, materials by face, smooth shading, and other modifiers."""
    begin(folder)
    thing = cube("Box", cuts=1)
    for colour in ("red", "blue"):
        thing.data.materials.append(bpy.data.materials.new(colour))
    for face in thing.data.polygons:
        face.material_index, face.use_smooth = face.index % 2, True
    bevel = thing.modifiers.new("Bevel", "BEVEL")
    bevel.width = 0.03
    uvs = [tuple(corner.uv) for corner in thing.data.uv_layers[0].data]
    part("BODY", thing)
    before = world(thing)
    assert press("preview") == ""
    falls(thing, before, 8)
    assert [tuple(corner.uv) for corner in thing.data.uv_layers[0].data] == uvs
    assert [f.material_index for f in thing.data.polygons] == [f.index % 2 for f in thing.data.polygons]
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    assert len(mesh.uv_layers) == 1 and {f.material_index for f in mesh.polygons} == {0, 1}
    assert len(mesh.vertices) == len(before) > len(thing.data.vertices)
    evaluated.to_mesh_clear()


def a_wedge_is_chosen_from(folder: Path) -> None:
    """Four velocities on a contact sheet; one is chosen, its value is taken over, and it is refined."""
    scene = begin(folder)
    thing = cube("My Box", cuts=1)
    part("BODY", thing, vertices="60 150")
    settings = scene.pdvol
    settings.varied, settings.first, settings.last, settings.count = "My_Box_speed_x", 0.0, 3.0, 4
    start = world(thing)
    assert press("choose") == "there is no variation yet: press Wedge"
    assert press("wedge") == ""
    sheet = bpy.data.images.load(str(places().wedge / "sheet.png"))
    assert min(sheet.size) > 200
    items = thumbnails.items()
    assert [item[1] for item in items] == ["0: 0", "1: 1", "2: 2", "3: 3"], items
    tiles = thumbnails.pictures()  # without a window they have no icons, but their pixels are read
    assert len(tiles) == 4 and all(min(tile.image_size) > 100 for tile in tiles)
    settings.chosen = "2"
    assert press("choose") == "" and scene.pdvol.run == 1
    assert math.isclose(thing.pdvol.velocity[0], 2.0)
    moved = (world(thing, 7) - start)[:, 0].mean()
    assert math.isclose(moved, 2.0 * 6 / 24, rel_tol=0.02), moved
    assert press("refine") == "" and sorted(stored_levels(places().run(1))) == [0, 1]
    settings.varied, settings.first, settings.last, settings.count = "friction", 0.1, 0.9, 2
    assert (
        press("wedge") == ""
        and json.loads((places().wedge / "wedge.json").read_text())["variations"][1]["state"] == "done"
    )


def it_goes_on_from_a_frame_with_another_animation(folder: Path) -> None:
    """A collider gets other keyframes from frame 7 on: what was before stays to the last bit, and can be refined."""
    scene = begin(folder, end=13)
    body = cube("soft", at=(0, 0, 0.6))
    part("BODY", body, vertices="60 150")
    plate = cube("plate", size=1.0, at=(0, 0, 0.2))
    plate.scale = (1.0, 1.0, 0.1)
    plate.keyframe_insert("location", frame=1)
    plate.keyframe_insert("location", frame=7)
    part("OBSTACLE", plate)
    assert press("preview") == ""
    before = [world(body, frame) for frame in range(1, 14)]
    scene.frame_set(7)
    plate.location.z = 0.5
    plate.keyframe_insert("location", frame=13)
    scene.frame_set(7)
    assert press("go_on_from_frame") == "" and scene.pdvol.run == 2
    after = [world(body, frame) for frame in range(1, 14)]
    assert all(np.array_equal(a, b) for a, b in zip(after[:7], before[:7], strict=True))
    assert after[-1][:, 2].mean() > before[-1][:, 2].mean() + 0.2
    assert press("refine") == "" and sorted(stored_levels(places().run(2))) == [0, 1]
    scene.pdvol.run = 1
    assert np.array_equal(world(body, 13), before[-1])
    plate.location.z = 0.8
    plate.keyframe_insert("location", frame=3)
    scene.pdvol.run, scene.frame_current = 2, 7
    assert "obstacle 'plate' is elsewhere at step" in press("go_on_from_frame")
    assert scene.pdvol.run == 2 and places().run_numbers() == [1, 2]
    scene.frame_set(1)
    assert press("go_on_from_frame").startswith("go to the frame")


def mistakes_are_one_line(folder: Path) -> None:
    """Each names what is wrong and what mends it, and nothing is begun."""
    begin(folder)
    assert press("preview").startswith("there is no soft body; select a mesh")
    assert press("refine") == "there is no run yet: press Preview"
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    for text, said in (("", "Vertices is ''"), ("200 abc", "write as 200 600"), ("600 200", "from coarse to fine")):
        thing.pdvol.vertices = text
        assert said in press("preview")
    thing.pdvol.vertices = "60"
    thing.pdvol.pins = "none"
    assert press("preview") == "'Box' has no vertex group 'none'; choose one of its own"
    thing.vertex_groups.new(name="none")
    assert "no vertex of the group 'none' has a weight of 0.5" in press("preview")
    thing.pdvol.pins = ""
    other = cube("Other", at=(2, 0, 1))
    part("BODY", other, vertices="60 200")
    assert "give all bodies as many" in press("preview")
    part("NONE", other)
    bpy.context.scene.frame_end = 1
    assert "give it two at least" in press("preview")
    bpy.context.scene.frame_end = 9
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    assert press("preview") == "'Box' is being edited: leave edit mode"
    bpy.ops.object.mode_set(mode="OBJECT")
    inside = cube("inside", size=0.1)
    part("BODY", inside)
    assert "inside" in press("preview") and tasks.session.error.count("\n") == 0
    part("NONE", inside)
    os.environ["PDVOL_COMMAND"] = "/nowhere/pdvol"
    assert press("check") == "cannot run /nowhere/pdvol: No such file or directory"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert press("preview").startswith("save the .blend first")


def a_mesh_that_was_edited_says_so(folder: Path) -> None:
    """After an edit the cache fits no more: a line says what to do, and a new preview fits again. Renamed ones, too."""
    begin(folder)
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    assert press("preview") == ""
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=1)
    bpy.ops.object.mode_set(mode="OBJECT")
    assert "preview again" in playback.show(bpy.context.scene)
    before = world(thing)
    thing.name = "Another"
    assert "'Box' is gone or was renamed: preview again" in playback.show(bpy.context.scene)
    assert press("preview") == ""
    falls(thing, before, 8)
    assert bpy.ops.pdvol.clear() == {"FINISHED"} and not thing.modifiers
    assert np.array_equal(world(thing, 8), before)


def an_object_that_moves_is_shown_where_the_simulation_has_it(folder: Path) -> None:
    """A body that hangs on a parent which turns, without pins: it falls in the world all the same."""
    begin(folder)
    bpy.ops.object.empty_add()
    parent = bpy.context.object
    thing = cube("Box", cuts=1, at=(0.0, 0.0, 2.0))
    thing.parent = parent
    parent.keyframe_insert("rotation_euler", frame=1)
    parent.rotation_euler = (0.5, 0.0, 1.5)
    parent.keyframe_insert("rotation_euler", frame=9)
    part("BODY", thing)
    before = world(thing, 1)
    assert press("preview") == ""
    falls(thing, before, 7)
    assert np.abs((world(thing, 7) - before)[:, :2]).max() < 0.01
    assert press("preview") == ""  # the cache does not become the animation
    assert np.abs((world(thing, 7) - before)[:, :2]).max() < 0.01


def a_check_finds_nothing_or_says_what(folder: Path) -> None:
    """Check writes the scene file and simulates nothing that is kept."""
    begin(folder)
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    assert press("check") == "" and tasks.session.message == "Check: done"
    assert tasks.session.notes[0].startswith("level 0: ") and tasks.session.notes[0].endswith(" s")
    assert places().scene.is_file() and places().run_numbers() == []
    thing.location.z = 0.1
    assert "ground" in press("check")


def the_panel_draws_what_there_is(folder: Path) -> None:
    """Each of its states, with a layout that knows whether properties and buttons exist; bpy has no window."""
    scene = begin(folder)
    body, plate = cube("Box", cuts=1), cube("plate", at=(3, 0, 0))
    shown = drawn()
    assert shown["texts"] == ["Body", "Obstacle", "Neither"] and {"ground", "height", "friction"} <= shown["properties"]
    part("OBSTACLE", plate)
    part("BODY", body)
    body.pdvol.preset = "OWN"
    body.pdvol.pins = "held"
    bpy.ops.pdvol.region(remove=-1)
    shown = drawn()
    assert {"young", "vertices", "reach", "repair", "group"} <= shown["properties"]
    assert {"pdvol.check", "pdvol.preview", "pdvol.refine", "pdvol.wedge"} <= shown["buttons"]
    assert "pdvol.cancel" not in shown["buttons"]
    bpy.ops.pdvol.region(remove=0)
    body.pdvol.pins = ""
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    assert "pdvol.cancel" in drawn()["buttons"]
    assert wait() == "" and "Preview: done" in drawn()["texts"] and "Levels 0 to 0 are stored" in drawn()["texts"]
    scene.pdvol.count = 2
    assert press("wedge") == "" and {"pdvol.choose"} <= drawn()["buttons"]
    body.location.z = 0.0
    assert press("check") and any("ground" in text for text in drawn()["texts"])


class Layout:
    """Takes what a panel draws, and refuses properties and buttons that do not exist."""

    def __init__(self, found: dict):
        self.found = found

    def row(self, **_: object) -> "Layout":
        return Layout(self.found)

    column = box = row

    def prop(self, data: object, name: str, text: str = "") -> None:
        getattr(data, name)
        self.found["properties"].add(name)

    def prop_search(self, data: object, name: str, inside: object, names: str, text: str = "") -> None:
        getattr(inside, names)
        self.prop(data, name)

    def template_icon_view(self, data: object, name: str, **_: object) -> None:
        self.prop(data, name)

    def operator(self, name: str, text: str | None = None, **_: object) -> object:
        group, _, short = name.partition(".")
        getattr(getattr(bpy.ops, group), short).get_rna_type()
        self.found["buttons"].add(name)
        self.label(text)
        return SimpleNamespace()

    def label(self, text: str | None) -> None:
        self.found["texts"] += [text] if text else []

    def progress(self, text: str, factor: float) -> None:
        assert text and 0.0 <= factor <= 1.0


def drawn() -> dict:
    """The properties, buttons and texts that the panels show now."""
    found: dict = {"properties": set(), "buttons": set(), "texts": []}
    context = SimpleNamespace(scene=bpy.context.scene, object=bpy.context.object, region=SimpleNamespace(width=280))
    for kind in panel.CLASSES:
        own = SimpleNamespace(layout=Layout(found), command="", source="")
        if hasattr(kind, "_draw_levels"):
            own._draw_levels = lambda context, own=own, kind=kind: kind._draw_levels(own, context)
        kind.draw(own, context)
    found["texts"] = [text for text in found["texts"] if text not in ("Add Region",)]
    return found


def pdvol_is_installed_into_an_environment_of_its_own(folder: Path) -> None:
    """Install makes a virtual environment beside the extension and takes pdvol from there from then on. The package is
    a wheel of a few lines here, which needs no net; pip installs it as any other.
    """
    begin(folder)
    wheel = folder / "pdvol-9.9-py3-none-any.whl"
    info = "pdvol-9.9.dist-info"
    with zipfile.ZipFile(wheel, "w") as made:
        made.writestr(
            "pdvol_echo.py", "import sys\ndef main(): print('pdvol: called with', *sys.argv[1:]); sys.exit(2)\n"
        )
        made.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: pdvol\nVersion: 9.9\n")
        made.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        made.writestr(f"{info}/entry_points.txt", "[console_scripts]\npdvol = pdvol_echo:main\n")
        made.writestr(f"{info}/RECORD", "")
    os.environ.pop("PDVOL_COMMAND")
    search = os.environ["PATH"]
    os.environ["PATH"] = str(folder)  # no pdvol, and no Python
    assert "there is no Python 3.12 or newer" in press("install")
    part("BODY", cube("Box", cuts=1))
    assert press("check").startswith("pdvol is not installed: press Install")
    os.environ["PATH"] = search
    python, own = environment.install_commands(environment.own_folder(), str(wheel))[0][0], environment.own_folder()
    for words in environment.install_commands(own, str(wheel))[:2]:
        tasks.session.start(Task("Install", [words]), Places(own / "install.blend"), (), 1.0)
        assert wait() == "", tasks.session.error
    assert Path(python).name.startswith("python3") and (own / "venv" / "pyvenv.cfg").is_file()
    os.environ["PATH"] = str(folder)
    assert environment.pdvol_words(bpy.context) == [str(own / "venv" / "bin" / "pdvol")]
    assert press("check").startswith("called with check ") and "--json" in tasks.session.error
    assert wheel.is_file() and not (folder / "venv").exists()


def the_extension_is_installed(folder: Path) -> None:
    """From its zip, as a user does; then it is switched off and on, and finds its own folder."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    repository = bpy.context.preferences.extensions.repos.new(
        name="Local", module="pdvol_test", custom_directory=str(folder / "repo")
    )
    repository.use_custom_directory = True
    (folder / "repo").mkdir(exist_ok=True)
    assert bpy.ops.extensions.package_install_files(
        filepath=os.environ["PDVOL_ZIP"], repo="pdvol_test", enable_on_install=True
    ) == {"FINISHED"}
    name = "bl_ext.pdvol_test.pdvol"
    assert name in bpy.context.preferences.addons and hasattr(bpy.ops.pdvol, "preview")
    assert sys.modules[name].__file__.startswith(str(folder))
    environment = sys.modules[f"{name}.addon.environment"]
    preferences = bpy.context.preferences.addons[name].preferences
    assert environment.PACKAGE == name and preferences.source == ""
    assert environment.own_folder().is_dir() and "pdvol" in environment.own_folder().parts
    words, own = os.environ.pop("PDVOL_COMMAND"), sys.modules[f"{name}.addon.tasks"]
    preferences.command = words
    assert environment.pdvol_words(bpy.context) == shlex.split(words)
    scene = bpy.context.scene
    scene.frame_end = 5
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    end = time.monotonic() + SAFETY
    while own.step(bpy.context):
        assert time.monotonic() < end
        time.sleep(0.05)
    assert own.session.error == "" and (folder / "shot_pdvol" / "play" / "1" / "level_0" / "Box.pc2").is_file()
    bpy.ops.preferences.addon_disable(module=name)
    assert not hasattr(bpy.types.Scene, "pdvol")
    bpy.ops.preferences.addon_enable(module=name)
    assert hasattr(bpy.types.Scene, "pdvol")


def main() -> None:
    """Carry one out."""
    name, folder = sys.argv[1:]
    globals()[name](Path(folder))
    print(f"{name} holds in Blender {bpy.app.version_string}", flush=True)
    os._exit(0)  # bpy as a module crashes after Python's end where any property has an update function


if __name__ == "__main__":
    main()
