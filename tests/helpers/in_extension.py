"""Scenarios of Blender's extension: a program for a Python that has the package bpy, apart from pdvol's environment.

    python in_extension.py SCENARIO FOLDER

PDVOL_COMMAND has the words that start pdvol. A scenario asserts what it promises; the exit status is 0 where it holds.
"""

import math
import os
import shlex
import subprocess
import time
from pathlib import Path

import bpy
import numpy as np

import extension_steps
from extension_steps import begin, carry_out, children, cube, falls, group, keyed, part, places, press, world

# isort: split
import blender
from blender.addon import playback, tasks, thumbnails
from blender.shot.files import read_pc2
from blender.work.stored import stored_levels


def bodies_of_all_kinds_fall_and_stay_what_they_are(folder: Path) -> None:
    """Centimetres, 30000/1001 frames a second from frame 10 on, three steps a frame. Names of all kinds; an object that
    is scaled unevenly, mirrored and hangs on a parent which turns; two objects of one mesh; a library override; UVs,
    materials by face and other modifiers; other subdivisions in renders; and a thrown one.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    cube("from afar", size=50, cuts=1)
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "library.blend"))
    scene = begin(folder, "mein 'Schuß' 1")
    scene.frame_start, scene.frame_end, scene.render.fps, scene.render.fps_base = 10, 20, 30, 1.001
    scene.unit_settings.system, scene.unit_settings.scale_length, scene.pdvol.steps = "METRIC", 0.01, 3
    with bpy.data.libraries.load(str(folder / "library.blend"), link=True) as (there, here):
        here.objects = list(there.objects)
    (linked,) = here.objects
    bpy.context.collection.objects.link(linked)
    extension_steps.refuses_as_body(linked, "make a library override first")
    linked = linked.override_create(remap_local_usages=True)
    linked.location = (0, -200, 150)
    assert linked.library is None and linked.data.library is not None

    bpy.ops.object.empty_add(location=(30, 0, 0))
    parent = bpy.context.object
    keyed(parent, "rotation_euler", {10: (0.0, 0.0, 0.0), 20: (0.3, 0.0, 0.7)})
    hung = cube("Würfel 1", size=1.0, at=(0, 0, 150), cuts=1)
    hung.parent, hung.scale, hung.rotation_euler = parent, (-40.0, 30.0, 20.0), (0.4, 0.2, 0.1)

    one = cube("Würfel_1", size=50, cuts=1, at=(0, 100, 150))
    two = one.copy()
    two.name, two.location = "a/b", (0, 200, 150)
    bpy.context.collection.objects.link(two)

    drawn_on = cube('say "x"', size=50, at=(0, 300, 150), cuts=1)
    for colour in ("red", "blue"):
        drawn_on.data.materials.append(bpy.data.materials.new(colour))
    for face in drawn_on.data.polygons:
        face.material_index, face.use_smooth = face.index % 2, True
    drawn_on.modifiers.new("Bevel", "BEVEL").width = 3
    uvs = [tuple(corner.uv) for corner in drawn_on.data.uv_layers[0].data]
    divided = cube("ground", size=50, at=(0, 400, 150))
    modifier = divided.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 1, 3
    thrown = cube("x" * 63, size=50, at=(0, 500, 150))

    things = [linked, hung, one, two, drawn_on, divided, thrown]
    part("BODY", *things, vertices="30")
    thrown.pdvol.velocity = (1.0, 2.0, 0.0)
    scene.frame_set(14)
    before = [world(thing, 10) for thing in things]
    scene.frame_set(14)
    assert press("preview") == "" and scene.frame_current == 14 and stored_levels(places().run(1)) == {0: 30}
    for thing, start in zip(things, before, strict=True):
        falls(thing, start, 18, metres=0.01)
        assert np.abs(world(thing, 5) - start).max() < 1e-3  # at rest before its first frame
        flown = (world(thing, 18) - start)[:, :2] - (np.array([100, 200]) * 8 * 1.001 / 30 if thing is thrown else 0.0)
        assert np.abs(flown).max() < 0.5, thing.name  # in the world, wherever its parent turns
    lines = places().meshes.joinpath("W_rfel_1.obj").read_text().splitlines()
    assert np.abs(np.loadtxt([line[2:] for line in lines if line[0] == "v"]) - 0.01 * before[1]).max() < 1e-6
    assert one.data == two.data and np.abs([v.co[:] for v in one.data.vertices]).max() <= 25.01  # as they were

    assert [tuple(corner.uv) for corner in drawn_on.data.uv_layers[0].data] == uvs
    mesh = drawn_on.evaluated_get(bpy.context.evaluated_depsgraph_get()).to_mesh()
    assert len(mesh.uv_layers) == 1 and {f.material_index for f in mesh.polygons} == {0, 1}
    assert len(mesh.vertices) > len(drawn_on.data.vertices)
    assert (modifier.levels, modifier.render_levels, modifier.show_viewport) == (1, 3, True)
    assert [m.name for m in divided.modifiers] == ["Subdivision", "pdvol", "pdvol render"]
    assert len(world(divided)) == 26
    modifier.levels = 3
    divided.modifiers["pdvol"].show_viewport, divided.modifiers["pdvol render"].show_viewport = False, True
    assert len(world(divided)) == 386
    falls(divided, before[things.index(divided)], 18, metres=0.01)


def a_preview_is_refined_and_opened_again(folder: Path) -> None:
    """Two bodies fall onto the ground. Levels are switched on one timeline; the scene file gives the same states on the
    command line; and the file shows the same after it was saved, opened again and moved.
    """
    scene = begin(folder, "my shot", end=13)
    thing, soft = cube("Box 1", cuts=1), cube("B", at=(0.1, 0, 0.4), cuts=1)
    part("BODY", thing, soft, vertices="60 200")
    soft.pdvol.preset = "SPONGE"
    before = world(thing)
    assert press("preview") == "" and scene.pdvol.run == 1
    level_0 = world(thing, 13)
    assert min(world(each)[:, 2].min() for each in (thing, soft)) > -0.02  # the ground
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert "Box 1" not in bpy.data.objects
    bpy.ops.wm.open_mainfile(filepath=str(folder / "my shot.blend"))
    thing, soft, scene = bpy.data.objects["Box 1"], bpy.data.objects["B"], bpy.context.scene
    assert np.array_equal(world(thing, 13), level_0) and soft.pdvol.preset == "SPONGE" and scene.pdvol.run == 1
    assert press("refine") == "" and scene.pdvol.level == 1
    level_1 = world(thing, 13)
    assert 1e-5 < np.abs(level_1 - level_0).max() < 0.1
    for scene.pdvol.level, shown in enumerate((level_0, level_1)):
        assert np.abs(world(thing) - shown).max() < 1e-6
    assert np.abs(world(thing, 1) - before).max() < 1e-5 and stored_levels(places().run(1)) == {0: 24, 1: 24}
    words = "run my\\ shot.py -o by\\ hand --no-picture --no-xdmf"
    command = shlex.split(f"{os.environ['PDVOL_COMMAND']} {words}")
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    for level in ("0", "1"):
        one, other = (run / "levels" / level / "states.bin" for run in (places().run(1), folder / "by hand"))
        assert one.read_bytes() == other.read_bytes(), level
    bpy.ops.wm.save_mainfile()
    there = folder / "moved"
    there.mkdir()
    for name in ("my shot.blend", "my shot.py", "my shot_pdvol"):
        (folder / name).rename(there / name)
    bpy.ops.wm.open_mainfile(filepath=str(there / "my shot.blend"))
    assert np.array_equal(world(bpy.data.objects["Box 1"], 13), level_1)


def pins_hold_and_follow_animation(folder: Path) -> None:
    """Bars are held at one end by a vertex group and hang, less where a half of one is rubber; what is pinned of a
    keyframed bar goes with it, also where it is shown.
    """
    scene = begin(folder, end=13)
    scene.pdvol.ground = False
    parts = (("plain", 1.0, 0.0), ("mixed", 1.0, 1.0), ("led", 0.3, 3.0))
    bars = [cube(name, size=size, cuts=3, at=(0, y, 1)) for name, size, y in parts]
    for thing in bars:
        end = min(v.co.x for v in thing.data.vertices)
        group(thing, "held end", lambda co, end=end: co.x < end + 0.01)
        group(thing, "stiff", lambda co: co.x < 0.3)
    for thing in bars[:2]:
        thing.scale = (1.0, 0.2, 0.2)
    part("BODY", *bars, vertices="120")
    for thing in bars:
        thing.pdvol.pins = "held end"
    bpy.context.view_layer.objects.active = bars[1]
    assert bpy.ops.pdvol.region(remove=-1) == {"FINISHED"}
    bars[1].pdvol.regions[0].group = "stiff"
    led = bars[2]
    led.pdvol.preset = "RUBBER"
    keyed(led, "location", {1: (0.0, 3.0, 1.0), 13: (0.5, 3.0, 1.0)})
    before = [world(thing, 1) for thing in bars]
    held = before[0][:, 0] < -0.49
    assert press("preview") == "" and places().meshes.joinpath("led.pc2").exists()
    assert places().scene.read_text().count("Region(NeoHookean(1000000.0") == 1
    for thing, start in zip(bars[:2], before, strict=False):
        assert np.abs(world(thing, 13) - start)[held].max() < 0.02
    sunk = [(b - world(thing, 13))[b[:, 0] > 0.49, 2].mean() for thing, b in zip(bars[:2], before, strict=False)]
    assert sunk[0] > 0.05 and sunk[1] < 0.5 * sunk[0], sunk
    for frame in (4, 13):
        moved = (world(led, frame) - before[2])[before[2][:, 0] < -0.14]
        assert np.abs(moved - [led.location.x, 0.0, 0.0]).max() < 0.01, frame  # where its keyframes have it
    assert math.isclose(led.location.x, 0.5, abs_tol=1e-6)


def animated_colliders_push(folder: Path) -> None:
    """A keyframed plate, one that is deformed by shape keys and one on a bone meet bodies in mid air; an open sheet
    lies beside them. An empty pulls another one from frame 3 on.
    """
    scene = begin(folder, end=13)
    scene.use_gravity, scene.pdvol.ground, scene.pdvol.friction = False, False, 0.0
    bodies = [cube(name, at=(x, 0, 1)) for name, x in (("left", -1), ("right", 1), ("soft", 4))]
    drawn = cube("drawn", at=(8, 0, 1))
    part("BODY", *bodies, drawn)
    bpy.ops.object.empty_add(location=(8, 0, 1.25))
    keyed(bpy.context.object, "location", {3: (8.0, 0.0, 1.25), 13: (9.0, 0.0, 1.25)})
    drawn.pdvol.pull, drawn.pdvol.pull_frames = bpy.context.object, (13, 3)
    assert press("preview").startswith("'drawn' is pulled in frames 13 to 3: choose two of 1 to 13")
    drawn.pdvol.pull_frames = (3, 13)
    plates = [cube(name, size=1.0, at=(x, 0, 0.6)) for name, x in (("plate", -1), ("bulge", 1), ("paddle", 4))]
    for plate in plates:
        plate.scale = (0.8, 0.8, 0.1)
    keyed(plates[0], "location", {1: (-1.0, 0.0, 0.6), 13: (-1.0, 0.0, 0.9)})
    plates[1].shape_key_add(name="Basis")
    key = plates[1].shape_key_add(name="up")
    for point in key.data:
        point.co.z += 3.0 if point.co.z > 0 else 0.0  # 0.3 m
    keyed(key, "value", {1: 0.0, 13: 1.0})
    bpy.ops.object.armature_add(location=(4, 0, 0.3))
    rig = bpy.context.object
    plates[2].modifiers.new("Armature", "ARMATURE").object = rig
    group(plates[2], "Bone", lambda co: True)
    keyed(rig.pose.bones[0], "location", {1: (0.0, 0.0, 0.0), 13: (0.0, 0.3, 0.0)})  # y is upward
    bpy.ops.mesh.primitive_plane_add(size=4.0, location=(4, 0, 0.05))
    part("OBSTACLE", *plates, bpy.context.object)
    starts = [world(thing, 1) for thing in bodies]
    assert math.isclose(world(plates[2], 13)[:, 2].max() - world(plates[2], 1)[:, 2].max(), 0.3, abs_tol=0.01)
    assert press("preview") == ""
    text = places().scene.read_text()
    assert "Deforming(PointCache" in text and 'name="Plane", closed=False' in text
    ways = [world(drawn, frame)[:, 0].mean() - 8.0 for frame in (3, 8, 13)]
    assert abs(ways[0]) < 1e-3 and 0.1 < ways[1] < ways[2] - 0.1 < 0.9, ways
    for thing, start, plate in zip(bodies, starts, plates, strict=True):
        assert world(thing, 13)[:, 2].min() > world(plate, 13)[:, 2].max() - 0.01, thing.name  # never through
        assert world(thing, 13)[:, 2].mean() > start[:, 2].mean() + 0.08


def mistakes_are_one_line(folder: Path) -> None:
    """Each names what is wrong and what repairs it, and nothing is begun; a check simulates nothing that is kept."""
    begin(folder)
    assert press("preview").startswith("there is no soft body; select a mesh")
    assert press("refine") == "there is no run yet: press Preview"
    inside = bpy.data.collections.new("inside")
    bpy.context.scene.collection.children.link(inside)
    bpy.ops.object.collection_instance_add(collection="inside")
    instance = bpy.context.object
    extension_steps.refuses_as_body(instance, "is an instance: make it real first")
    bpy.data.objects.remove(instance)
    thing = cube("Box", cuts=1)
    part("BODY", thing)
    assert press("check") == "" and tasks.session.message == "Check: done"
    assert tasks.session.notes[0].startswith("level 0: ") and tasks.session.notes[0].endswith(" s")
    assert places().scene.is_file() and places().run_numbers() == []
    thing.location.z = 0.1
    assert "ground" in press("check") and tasks.session.message == "Check: not sound"
    thing.location.z = 1.0
    for thing.pdvol.vertices, said in (("", "Vertices is ''"), ("200 x", "write as"), ("600 200", "coarse to fine")):
        assert said in press("preview")
    thing.pdvol.vertices, thing.pdvol.pins = "60", "none"
    assert press("preview") == "'Box' has no vertex group 'none'; choose one of its own"
    thing.vertex_groups.new(name="none")
    assert "no vertex of the group 'none' has a weight of 0.5" in press("preview")
    thing.pdvol.pins = ""
    other = cube("Other", at=(2, 0, 1))
    part("BODY", other, vertices="60 200")
    assert "give all bodies as many" in press("preview")
    part("NONE", other)
    for bpy.context.scene.frame_end, said in ((1, "give it two at least"), (9, "")):
        assert said in press("check")
    bpy.context.view_layer.objects.active = thing
    bpy.ops.object.mode_set(mode="EDIT")
    assert press("preview") == "'Box' is being edited: leave edit mode"
    bpy.ops.object.mode_set(mode="OBJECT")
    mesh = bpy.data.meshes.new("fins")
    corners = [(0, 0, 1), (0, 0, 1.5), (1, 0, 1), (-1, 1, 1), (-1, -1, 1)]
    mesh.from_pydata(corners, [], [(0, 1, 2), (0, 1, 3), (0, 1, 4)])
    fins = bpy.data.objects.new("fins", mesh)
    bpy.context.collection.objects.link(fins)
    nothing = bpy.data.objects.new("nothing", bpy.data.meshes.new("nothing"))
    bpy.context.collection.objects.link(nothing)
    for nested, said in ((cube("inside", size=0.1), "inside"), (fins, "fins"), (nothing, "'nothing' has no faces: it")):
        part("BODY", nested)
        assert said in press("preview") and "\n" not in tasks.session.error
        part("NONE", nested)
    os.environ["PDVOL_COMMAND"] = "/nowhere/pdvol"
    assert press("check") == "cannot run /nowhere/pdvol: No such file or directory"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert press("preview").startswith("save the .blend first")


def a_body_is_closed_edited_and_renamed(folder: Path) -> None:
    """A cube with a hole is refused by name; its closed copy falls, and the open one is drawn. After an edit or
    another name the cache fits no more: a line says what to do, and a new preview fits again.
    """
    begin(folder)
    thing = cube("open box", cuts=2)
    edit = lambda mode: bpy.ops.object.mode_set(mode=mode)
    edit("EDIT")
    bpy.ops.mesh.select_all(action="DESELECT")
    edit("OBJECT")
    for face in thing.data.polygons:
        face.select = face.center.z > 0.24 and max(map(abs, face.center[:2])) < 0.1
    edit("EDIT")
    bpy.ops.mesh.delete(type="FACE")
    edit("OBJECT")
    part("BODY", thing)
    error = press("preview")
    assert "open_box" in error and "tick Close holes" in error and "\n" not in error, error
    assert "tick Close holes" in press("check")
    assert thing.pdvol.bl_rna.properties["repair"].name == "Close holes"
    thing.pdvol.repair = True
    before = world(thing)
    error = press("preview")
    assert error == "", error
    falls(thing, before, 8)
    assert len(world(thing)) == len(thing.data.vertices)
    edit("EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=1)
    edit("OBJECT")
    assert "preview again" in playback.show(bpy.context.scene)
    before = world(thing)
    thing.name = "Another"
    assert "'open box' is gone or was renamed: preview again" in playback.show(bpy.context.scene)
    error = press("preview")
    assert error == "", error
    falls(thing, before, 8)
    assert bpy.ops.pdvol.clear() == {"FINISHED"} and not thing.modifiers
    assert np.array_equal(world(thing, 8), before)


def what_goes_on_can_be_looked_at_and_cancelled(folder: Path) -> None:
    """Frames arrive while a preview runs. It is cancelled in the middle, and gone on with to the same end. Another file
    ends what goes on, and so does an extension that is switched off.
    """
    os.environ["PDVOL_SCENARIO"] = str(os.getpid())
    scene = begin(folder, end=100)
    thing = cube(cuts=2)
    part("BODY", thing, vertices="300")
    before = world(thing)
    assert bpy.ops.pdvol.preview() == {"FINISHED"}
    cache, end = places().caches(1, 0) / "Cube.pc2", time.monotonic() + extension_steps.SAFETY
    while not cache.exists() or len(read_pc2(cache)) < 6:
        assert tasks.step(bpy.context) and time.monotonic() < end
        time.sleep(0.02)
    falls(thing, before, 5)
    assert children() and not bpy.ops.pdvol.preview.poll()
    assert bpy.ops.pdvol.cancel() == {"FINISHED"}
    assert children() == [] and tasks.session.message == "Preview: cancelled"
    assert 5 <= stored_levels(places().run(1))[0] < 198
    assert press("resume") == "" and stored_levels(places().run(1))[0] == 198
    assert scene.pdvol.run == 1 and len(read_pc2(cache)) == 100
    for end_all in (lambda: bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True), blender.unregister):
        begin(folder, "second", end=240)
        part("BODY", cube(cuts=2), vertices="300")
        assert bpy.ops.pdvol.preview() == {"FINISHED"}
        assert any(children() for _ in range(1000))  # a process that begins has no environment for a moment
        end_all()
        assert children() == [] and not tasks.session.busy


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


def it_goes_on_from_a_frame_with_another_animation(folder: Path) -> None:
    """A collider gets other keyframes from frame 7 on: what was before stays to the last bit, and can be refined."""
    scene = begin(folder, end=13)
    body = cube("soft", at=(0, 0, 0.6))
    part("BODY", body, vertices="60 150")
    plate = cube("plate", size=1.0, at=(0, 0, 0.2))
    plate.scale = (1.0, 1.0, 0.1)
    keyed(plate, "location", {1: (0.0, 0.0, 0.2), 7: (0.0, 0.0, 0.2)})
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


if __name__ == "__main__":
    carry_out(globals())
