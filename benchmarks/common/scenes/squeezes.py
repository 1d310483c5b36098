"""Bodies that moving obstacles squeeze, with pdvol's default model; a scene file.

    ./run pdvol run benchmarks/common/scenes/squeezes.py --set name=gears

SI units, y up.
"""

import math
import sys
from pathlib import Path as File

import numpy as np

import pdvol
from pdvol import Body, NeoHookean, Outline, Path, Placement, Rigid, Rotation, Scene, Sequential, Support, Translation
from pdvol.meshes import ball, bar, box, cylinder, extrude, torus, turned

sys.path.append(str(File(__file__).resolve().parents[3]))  # as a scene file it is no part of a package

from benchmarks.common.scenes import FLOOR, ORIGIN, X_AXIS, Z_AXIS, falling, named

ALONG_Z = math.pi / 2, X_AXIS
"""Angle and axis that lay a cylinder, which stands along y, along z."""


def soft(shape, vertices: int, young: float = 1e4, at: tuple = (0.0, 0.0, 0.0)) -> Body:
    """A body of a soft, slightly damped jelly with its centre at a place [m]."""
    material = NeoHookean(young, 0.42, 1000.0, damping=0.01)
    return Body(shape, material, (vertices,), name="body", placement=Placement(at))


def pin(vertices: int = 500, left: float = 0.02, speed: float = 0.5) -> Scene:
    """A turning rolling pin comes down on dough of 0.06 m, to `left` [m] above the table, and rolls across it."""
    radius = 0.06
    start, low = (-0.22, 0.07 + radius, 0.0), left - 0.07
    way = Path((0.0, 0.15, 0.9), ((0.0, 0.0, 0.0), (0.15 * speed, low, 0.0), (0.9 * speed, low, 0.0)))
    rolls = Sequential((Rotation(-speed / radius, start, Z_AXIS), way))
    dough = soft(box((0.5, 0.06, 0.3), (20, 3, 12)), vertices, 8e3, (0.0, 0.032, 0.0))
    rolling = Rigid(cylinder(radius, 0.5, 48), Placement(start, *ALONG_Z), rolls, "pin")
    return falling([dough], 56, 0.015, 0.5, obstacles=(FLOOR, rolling))


def gear(root: float, tip: float, teeth: int, thickness: float):
    """A gear about the z axis with trapezoidal teeth, one centred on +x; radii in metres."""
    corners = ((-0.30, root), (-0.13, tip), (0.13, tip), (0.30, root))
    turns = [(2.0 * math.pi * (k + share) / teeth, radius) for k in range(teeth) for share, radius in corners]
    return extrude(Outline(np.array([(r * math.cos(a), r * math.sin(a)) for a, r in turns])), thickness)


def gears(vertices: int = 450, turns: float = 0.4, apart: float = 0.34, teeth: int = 12) -> Scene:
    """Two meshing gears, `turns` [1/s], with axes `apart` [m], draw a block in between their teeth."""

    def wheel(side: int, turned_by: float) -> Rigid:
        centre = (0.5 * side * apart, 0.0, 0.0)
        turning = Rotation(2.0 * side * math.pi * turns, centre, Z_AXIS)
        return Rigid(gear(0.12, 0.16, teeth, 0.3), Placement(centre, turned_by), turning, f"gear {side}")

    block = soft(box((0.09, 0.28, 0.2), (4, 12, 9)), vertices, at=(0.0, 0.27, 0.0))
    wheels = (wheel(-1, 0.0), wheel(1, math.pi + math.pi / teeth))
    return falling([block], 55, 0.015, 0.5, obstacles=wheels)


def piston(vertices: int = 500) -> Scene:
    """A turning piston presses a ball down in a cup, and rests."""
    walls = [(0.0, 0.0), (0.16, 0.0), (0.16, 0.4), (0.13, 0.4), (0.13, 0.03), (0.0, 0.03)]
    start = (0.0, 0.34, 0.0)
    down = Path((0.0, 0.5, 1.0), ((0.0, 0.0, 0.0), (0.0, -0.17, 0.0), (0.0, -0.17, 0.0)))
    pressing = Sequential((Rotation(3.0, start, (0.0, 1.0, 0.0)), down))
    plunger = Rigid(cylinder(0.12, 0.1, 32), Placement(start), pressing, "piston")
    obstacles = (Rigid(turned(np.array(walls)), name="cup"), plunger)
    return falling([soft(ball(0.115, 3), vertices, at=(0.0, 0.15, 0.0))], 50, 0.02, 0.4, obstacles=obstacles)


def ring(vertices: int = 500) -> Scene:
    """A bar of 0.2 x 0.2 m is pulled by the middle of its end through a ring of 0.18 m."""
    middle = lambda X: (X[:, 0] > 0.39) & (np.abs(X[:, 1:]) < 0.06).all(axis=1)
    end = Support(middle, motion=Translation((0.9, 0.0, 0.0)))
    narrow = Rigid(torus(0.16, 0.07, 32, 16), Placement((0.55, 0.0, 0.0), math.pi / 2, Z_AXIS), name="ring")
    pulled = soft(bar(0.8, 0.2, 0.2, 0.05), vertices)
    return falling([pulled], 40, 0.02, 0.2, obstacles=(narrow,), supports=(end,))


def belts(vertices: int = 500) -> Scene:
    """Two slanted belts close on a ball and carry it up."""

    def belt(side: int) -> Rigid:
        close = -0.04 * side
        way = Path((0.0, 0.2, 2.0), ((0.0, 0.0, 0.0), (close, 0.0, 0.0), (close, 1.0, 0.0)))
        place = Placement((0.128 * side, 0.0, 0.0), -0.02 * side, Z_AXIS)
        return Rigid(box((0.05, 2.0, 0.5), (1, 20, 5)), place, way, f"belt {side}")

    return falling([soft(ball(0.1, 3), vertices, 8e3)], 50, 0.02, 0.7, obstacles=(belt(-1), belt(1)))


def capstan(vertices: int = 500) -> Scene:
    """A strap lies over a drum of eight sides that turns."""
    drum = Rigid(cylinder(0.15, 0.4, 8), Placement(ORIGIN, *ALONG_Z), Rotation(4.0, ORIGIN, Z_AXIS), "drum")
    strap = soft(box((0.8, 0.05, 0.12), (24, 2, 4)), vertices, 2e4, (0.0, 0.19, 0.0))
    return falling([strap], 40, 0.02, 0.6, obstacles=(drum,))


SCENES = {"pin": pin, "gears": gears, "piston": piston, "ring": ring, "belts": belts, "capstan": capstan}
"""Functions by name."""


def scene(name: str = "pin", **other) -> Scene:
    """One of `SCENES`, with what its function takes."""
    return named(SCENES, name, **other)


if __name__ == "__main__":
    pdvol.main(scene)
