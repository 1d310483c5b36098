"""Animations as Blender exports them: a program for a Python that has the package bpy, apart from pdvol's environment.

    python rig_in_blender.py FOLDER

Writes rig.abc and rig.usdc into the folder, and where Blender itself has the points of both meshes at every frame
prints one JSON object: by name, frame by frame. `hand` hangs on an empty that moves and turns, and changes its shape by
shape keys; `finger` is bent by an armature of two bones.
"""

import json
import math
import sys

import bpy

FRAMES = range(1, 13)


def hand() -> None:
    """A box with shape keys, below an empty."""
    bpy.ops.mesh.primitive_cube_add(size=2.0)
    box = bpy.context.object
    box.name = "hand"
    rig = bpy.data.objects.new("rig", None)
    bpy.context.scene.collection.objects.link(rig)
    box.parent = rig
    box.shape_key_add(name="Basis")
    wide = box.shape_key_add(name="wide")
    for vertex in wide.data:
        vertex.co.x *= 2
    for frame, share in ((FRAMES[0], 0.0), (FRAMES[-1], 1.0)):
        wide.value = share
        wide.keyframe_insert("value", frame=frame)
        rig.location, rig.rotation_euler = (0, 0, 3 * share), (0, 0, 1.5 * share)
        rig.keyframe_insert("location", frame=frame)
        rig.keyframe_insert("rotation_euler", frame=frame)


def finger() -> None:
    """A cylinder that two bones bend."""
    bpy.ops.mesh.primitive_cylinder_add(vertices=8, radius=0.3, depth=2.0, location=(5, 0, 0))
    skin = bpy.context.object
    skin.name = "finger"
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.subdivide(number_cuts=3)
    bpy.ops.object.mode_set(mode="OBJECT")
    bpy.ops.object.armature_add(location=(5, 0, -1))
    bones = bpy.context.object
    bones.name = "bones"
    bpy.ops.object.mode_set(mode="EDIT")
    lower = bones.data.edit_bones[0]
    lower.name, lower.tail = "lower", (0, 0, 1)
    upper = bones.data.edit_bones.new("upper")
    upper.parent, upper.head, upper.tail = lower, (0, 0, 1), (0, 0, 2)
    bpy.ops.object.mode_set(mode="OBJECT")
    skin.select_set(True)
    bones.select_set(True)
    bpy.context.view_layer.objects.active = bones
    bpy.ops.object.parent_set(type="ARMATURE_AUTO")
    pose = bones.pose.bones["upper"]
    pose.rotation_mode = "XYZ"
    for frame, turn in ((FRAMES[0], 0.0), (FRAMES[-1], math.pi / 3)):
        pose.rotation_euler = (turn, 0, 0)
        pose.keyframe_insert("rotation_euler", frame=frame)


def main() -> None:
    """Build, export, print."""
    folder = sys.argv[1]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = 24, FRAMES[0], FRAMES[-1]
    hand()
    finger()
    bpy.ops.wm.alembic_export(filepath=f"{folder}/rig.abc", as_background_job=False)
    bpy.ops.wm.usd_export(filepath=f"{folder}/rig.usdc", export_animation=True)
    found = {"hand": [], "finger": []}
    for frame in FRAMES:
        scene.frame_set(frame)
        for name, points in found.items():
            thing = bpy.data.objects[name].evaluated_get(bpy.context.evaluated_depsgraph_get())
            points.append([list(thing.matrix_world @ vertex.co) for vertex in thing.to_mesh().vertices])
    print("\nFOUND", json.dumps(found))


main()
