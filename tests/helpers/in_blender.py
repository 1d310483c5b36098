"""What Blender makes of exports: a program for a Python that has the package bpy, apart from pdvol's environment.

    python in_blender.py WHAT FILE [--fields]

WHAT is usd, pc2 or alembic. Prints one JSON object; with --fields it has attributes of meshes at every frame. pc2 takes
the script open_in_blender.py of an export.
"""

import json
import runpy
import sys

import bpy
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


def load(what: str, file: str) -> None:
    """Import into an empty scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if what == "usd":
        bpy.ops.wm.usd_import(filepath=file)
    elif what == "alembic":
        bpy.ops.wm.alembic_import(filepath=file, as_background_job=False)
    else:
        runpy.run_path(file)


def main() -> None:
    """Import, measure, print."""
    what, file, *fields = sys.argv[1:]
    load(what, file)
    scene = bpy.context.scene
    things = [o for o in bpy.data.objects if o.type == "MESH"]
    found = {
        "fps": scene.render.fps / scene.render.fps_base,
        "frames": [scene.frame_start, scene.frame_end],
        "unit": scene.unit_settings.scale_length,
        "meshes": {
            o.name: {
                "colour": base_colour(o) if o.data.materials else None,
                "texture": texture(o),
                "uvs": [list(corner.vector) for corner in o.data.uv_layers[0].uv] if o.data.uv_layers else [],
                "points": {},
                "fields": {},
            }
            for o in things
        },
    }
    for frame in range(scene.frame_start, min(scene.frame_end, 40) + 1):
        scene.frame_set(frame)
        for o in things:
            found["meshes"][o.name]["points"][frame] = points_of(o).tolist()
            if fields:
                found["meshes"][o.name]["fields"][frame] = fields_of(o)
    print("\nFOUND", json.dumps(found))


main()
