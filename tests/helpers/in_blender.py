"""What Blender makes of exports: a program for a Python that has the package bpy, apart from pdvol's environment.

    python in_blender.py WHAT FILES ... [--fields] [--picture OUT.png]

WHAT is usd, pc2 or alembic. Prints one JSON object; with --fields it has attributes of meshes at every frame. pc2 takes
the script open_in_blender.py of an export. The picture shows the middle frame, as Cycles renders it.
"""

import json
import runpy
import sys

import bpy
import mathutils
import numpy as np


def points_of(thing) -> np.ndarray:
    """(n, 3) world coordinates of an object at the current frame."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    found = np.array([thing.matrix_world @ vertex.co for vertex in mesh.vertices])
    evaluated.to_mesh_clear()
    return found


def fields_of(thing) -> dict:
    """By name: attributes of numbers and vectors of an object at the current frame, as modifiers have left them."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh, found = evaluated.to_mesh(), {}
    for attribute in mesh.attributes:
        if attribute.data_type in ("FLOAT", "FLOAT_VECTOR") and attribute.name != "position":
            key = "value" if attribute.data_type == "FLOAT" else "vector"
            found[attribute.name] = [np.array(getattr(entry, key)).tolist() for entry in attribute.data]
    evaluated.to_mesh_clear()
    return found


def flat_corners(thing) -> float:
    """How many corners of an object at the current frame have the normal of their face, of one."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    corners = [mesh.corner_normals[i].vector @ face.normal for face in mesh.polygons for i in face.loop_indices]
    evaluated.to_mesh_clear()
    return float(np.mean(np.array(corners) > 0.9999))


def base_colour(thing) -> list[float]:
    """Linear red, green, blue and alpha of an object's material."""
    (material,) = thing.data.materials
    (shader,) = (node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    return [*list(shader.inputs["Base Color"].default_value)[:3], shader.inputs["Alpha"].default_value]


def texture(thing) -> str:
    """The picture that an object's material takes its colour from, empty if none."""
    pictures = [node for m in thing.data.materials for node in m.node_tree.nodes if node.type == "TEX_IMAGE"]
    linked = [node for node in pictures if any(o.is_linked for o in node.outputs)]
    return linked[0].image.filepath if linked else ""


def load(what: str, files: list[str]) -> None:
    """Import into an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if what == "usd":
        bpy.ops.wm.usd_import(filepath=files[0])
    elif what == "alembic":
        bpy.ops.wm.alembic_import(filepath=files[0], as_background_job=False)
    else:
        runpy.run_path(files[0])


def render(path: str) -> None:
    """A picture of the current frame from the front, right and above."""
    scene = bpy.context.scene
    bodies = [o for o in bpy.data.objects if o.type == "MESH" and "ground" not in o.name and "floor" not in o.name]
    points = np.concatenate([points_of(o) for o in bodies])
    low, high = points.min(axis=0), points.max(axis=0)
    centre, size = mathutils.Vector((low + high) / 2), float(np.linalg.norm(high - low))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = centre + size * mathutils.Vector((0.75, -1.35, 0.7))
    camera.rotation_euler = (centre - camera.location).to_track_quat("-Z", "Y").to_euler()
    lamp = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    lamp.data.energy, lamp.data.angle, lamp.rotation_euler = 3.0, 0.2, (0.6, 0.2, 0.5)
    for thing in (camera, lamp):
        scene.collection.objects.link(thing)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.9, 0.88, 0.85, 1)
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0.5
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 24
    scene.cycles.use_denoising = False
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 480, 360, 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def main() -> None:
    """Import, measure, print."""
    arguments = sys.argv[1:]
    picture = arguments.pop() if "--picture" in arguments else None
    if picture:
        arguments.remove("--picture")
    fields = "--fields" in arguments
    what, *files = [word for word in arguments if word != "--fields"]
    load(what, files)
    scene = bpy.context.scene
    things = [o for o in bpy.data.objects if o.type == "MESH"]
    found = {
        "version": bpy.app.version_string,
        "fps": scene.render.fps / scene.render.fps_base,
        "frames": [scene.frame_start, scene.frame_end],
        "unit": scene.unit_settings.scale_length,
        "meshes": {
            o.name: {
                "colour": base_colour(o) if o.data.materials else None,
                "attributes": {a.name: a.domain for a in o.data.attributes},
                "modifiers": [m.type for m in o.modifiers],
                "texture": texture(o),
                "uvs": [list(corner.vector) for corner in o.data.uv_layers[0].uv] if o.data.uv_layers else [],
                "points": {},
                "fields": {},
                "flat_corners": [],
            }
            for o in things
        },
    }
    for frame in range(scene.frame_start, min(scene.frame_end, 40) + 1):
        scene.frame_set(frame)
        for o in things:
            found["meshes"][o.name]["points"][frame] = points_of(o).tolist()
            found["meshes"][o.name]["flat_corners"].append(flat_corners(o))
            if fields:
                found["meshes"][o.name]["fields"][frame] = fields_of(o)
    if picture:
        scene.frame_set((scene.frame_start + min(scene.frame_end, 40)) // 2)
        render(picture)
    print("\nFOUND", json.dumps(found))


main()
