"""The walk of docs/blender.md, done by the extension's own buttons, with its pictures and how long each button took:

    PDVOL_COMMAND="./run pdvol" PYTHON docs/_site/blender_walk.py FOLDER

PYTHON has the packages bpy and pillow. FOLDER gets the .blend with all that lies beside it, and the pictures.
"""

import math
import os
import sys
import time
from pathlib import Path

import bpy
from mathutils import Vector
from PIL import Image

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
import blender
from blender.addon import playback, tasks

FRAMES = 49
SHOWN = (1, 9, 13, 21, 49)
"""Frames of the strips."""
SIZE = (400, 300)  # pixels of a picture
SAMPLES = 32  # rays a pixel, which are denoised
LONGEST = 600.0  # seconds that a button may take


def main(folder: Path) -> None:
    """Walk, and print seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    build(folder)
    strip(folder / "start.webp", ["start"], (1,))
    scene, ball, monkey = bpy.context.scene, bpy.data.objects["Ball"], bpy.data.objects["Monkey"]

    choose_part("BODY", monkey, ball)
    choose_part("OBSTACLE", bpy.data.objects["Pedestal"])
    monkey.pdvol.preset, monkey.pdvol.vertices, monkey.pdvol.repair = "MEAT", "250 800 2500", True
    ball.pdvol.preset, ball.pdvol.vertices, ball.pdvol.velocity = "RUBBER", "60 200 700", (2.0, 0.0, 1.0)
    scene.pdvol.friction = 0.5
    press("check")
    print("\n".join(tasks.session.notes))
    press("preview")
    strip(folder / "preview.webp", ["preview"], SHOWN)

    scene.pdvol.varied = "Ball_speed_x"
    scene.pdvol.first, scene.pdvol.last, scene.pdvol.count = 1.0, 6.0, 6
    press("wedge")
    sheet = Image.open(playback.places_of().wedge / "sheet.png").convert("RGB")
    sheet.thumbnail((1100, 1100))
    sheet.save(folder / "sheet.webp", quality=80)
    scene.pdvol.chosen = "3"
    press("choose")
    scene.pdvol.refine_to = 2
    press("refine")
    strip(folder / "levels.webp", ["level 0", "level 1", "level 2"], SHOWN[1:])
    film(folder / "shot.webp")
    bpy.ops.wm.save_mainfile()
    os._exit(0)  # bpy as a module crashes after Python's end where any property has an update function


def build(folder: Path) -> None:
    """Three objects, a floor to look at, light and a camera; saved."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender.register()
    scene = bpy.context.scene
    scene.frame_end = FRAMES
    bpy.ops.mesh.primitive_plane_add(size=400.0)
    dressed("Floor", (0.3, 0.29, 0.27))
    bpy.ops.mesh.primitive_cylinder_add(radius=0.35, depth=0.8, location=(0.0, 0.0, 0.4), vertices=48)
    dressed("Pedestal", (0.3, 0.32, 0.36))
    bpy.ops.mesh.primitive_monkey_add(size=0.9, location=(0.0, 0.0, 1.28), rotation=(-0.62, 0.0, 0.5))
    dressed("Monkey", (0.8, 0.32, 0.12))
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.22, location=(-1.6, 0.0, 1.0), segments=32, ring_count=16)
    dressed("Ball", (0.1, 0.3, 0.6))
    lamp = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    lamp.data.energy, lamp.data.angle, lamp.rotation_euler = 3.0, 0.15, (0.75, 0.2, 0.4)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = Vector((1.9, -5.2, 2.3))
    camera.rotation_euler = (Vector((0.1, 0.0, 0.72)) - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.lens = 54
    for thing in (lamp, camera):
        scene.collection.objects.link(thing)
    scene.camera, scene.world = camera, bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (0.75, 0.82, 0.95, 1.0)
    scene.world.node_tree.nodes["Background"].inputs[1].default_value = 0.6
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", SAMPLES
    scene.cycles.use_denoising = True
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "shot.blend"))


def dressed(name: str, colour: tuple[float, float, float]) -> None:
    """Name the active object, and give it a material."""
    thing = bpy.context.object
    thing.name = name
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*colour, 1.0)
    material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.45
    thing.data.materials.append(material)
    if name in ("Monkey", "Ball"):
        thing.data.shade_smooth()


def choose_part(role: str, *things: bpy.types.Object) -> None:
    """Select, and press Body or Obstacle."""
    bpy.ops.object.select_all(action="DESELECT")
    for thing in things:
        thing.select_set(True)
    bpy.ops.pdvol.part(role=role)


def press(button: str) -> None:
    """Press a button and wait for its end; prints how long that took."""
    begin = time.monotonic()
    getattr(bpy.ops.pdvol, button)()
    while tasks.step(bpy.context):
        if time.monotonic() - begin > LONGEST:
            raise SystemExit(f"{button} takes longer than {LONGEST:g} s")
        time.sleep(0.1)
    print(f"{button}: {time.monotonic() - begin:.1f} s; {tasks.session.message}", flush=True)
    if tasks.session.error:
        raise SystemExit(tasks.session.error)


def strip(out: Path, rows: list[str], frames: tuple[int, ...]) -> None:
    """Frames beside each other, of each level below each other."""
    scene = bpy.context.scene
    whole = Image.new("RGB", (len(frames) * SIZE[0], len(rows) * SIZE[1]))
    for row, name in enumerate(rows):
        if name.startswith("level"):
            scene.pdvol.level = int(name.split()[1])
        for column, frame in enumerate(frames):
            whole.paste(rendered(out.parent, frame), (column * SIZE[0], row * SIZE[1]))
    whole.thumbnail((1200, 1200))
    whole.save(out, quality=82)


def film(out: Path) -> None:
    """The shown level, each second frame."""
    begin = time.monotonic()
    frames = [rendered(out.parent, frame) for frame in range(1, FRAMES + 1, 2)]
    print(f"render: {(time.monotonic() - begin) / len(frames):.1f} s a frame of {SIZE[0]} x {SIZE[1]} pixels")
    duration = math.ceil(2000.0 / 24.0)
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=duration, loop=0, quality=60)


def rendered(folder: Path, frame: int) -> Image.Image:
    """A frame, as Cycles renders it."""
    scene = bpy.context.scene
    scene.frame_set(frame)
    scene.render.filepath = str(folder / "frame.png")
    bpy.ops.render.render(write_still=True)
    return Image.open(folder / "frame.png").convert("RGB")


if __name__ == "__main__":
    main(Path(sys.argv[1]).resolve())
