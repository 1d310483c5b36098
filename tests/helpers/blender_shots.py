"""Shots as Blender's extension describes them, made without Blender."""

from pathlib import Path

import numpy as np

from blender.shot.description import PRESETS, Body, Group, Mesh, Obstacle, Pin, Region, Shot
from blender.shot.files import Places
from pdvol import Surface, meshes

JELLY, RUBBER = PRESETS["JELLY"][1], PRESETS["RUBBER"][1]
STEPS = 2  # time steps a frame


def mesh_of(surface: Surface, shift=(0.0, 0.0, 0.0)) -> Mesh:
    """A surface of pdvol as the extension's."""
    faces = np.asarray(surface.triangles, dtype=np.int64)
    return Mesh(np.asarray(surface.vertices, dtype=float) + np.array(shift), np.full(len(faces), 3), faces.ravel())


def group(name: str, mask: np.ndarray) -> Group:
    """A group of the vertices of a mask."""
    return Group(name, mask.astype(float))


def two_bodies(frames: int = 3) -> Shot:
    """A bar with a rubber end is pinned at the other one and led upward; a ball, drawn finer in renders, falls onto a
    plate that moves.
    """
    bar = mesh_of(meshes.box((1.0, 0.2, 0.2), (10, 2, 2)), (0.0, 0.0, 1.5))
    rise = np.linspace(0.0, 0.1, frames * STEPS + 1)[:, None, None] * np.array([0.0, 0.0, 1.0])
    left, right = bar.points[:, 0] < -0.49, bar.points[:, 0] > 0.1
    ball = mesh_of(meshes.ball(0.2, 2), (0.0, 0.0, 0.4))
    plate = mesh_of(meshes.box((1.0, 1.0, 0.05)), (0.0, 0.0, 0.1))
    return Shot(
        source="two.blend",
        bodies=(
            Body(
                "bar",
                "the bar",
                bar,
                None,
                bar.points + rise,
                JELLY,
                (80, 200),
                pins=(Pin(group("held end", left), 0.02),),
                regions=(Region(group("stiff end", right), RUBBER),),
            ),
            Body(
                "ball",
                "Ball.001",
                ball,
                mesh_of(meshes.ball(0.2, 3), (0.0, 0.0, 0.4)),
                None,
                RUBBER,
                (60, 200),
                (0.0, 0.0, -1.0),
            ),
        ),
        obstacles=(Obstacle("plate", "Plate", plate, plate.points - rise),),
        ground=-0.5,
        frames=frames,
        steps_a_frame=STEPS,
    )


def places(folder: Path) -> Places:
    """The files of a shot, beside a .blend that is not there."""
    return Places(folder / "my shot.blend")
