"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from . import outlines, solids, toys
from .ape import ape
from .contours import gear, seahorse
from .creature import creature
from .dolphin import dolphin
from .geometry import Outline, Solid, Surface
from .grids import brick, hollow_ball, hollow_brick
from .jellies import bunny, frog
from .outlines import comb, disc, extrude, folded, polygon, rectangle, rope, slit_array, spike
from .solids import ball, bar, box
from .toys import beach_ball, letter, propeller, trampoline, worm
from .turned import bowl, cylinder, funnel, torus, turned

__all__ = [
    "Outline",
    "Solid",
    "Surface",
    "ape",
    "ball",
    "bar",
    "beach_ball",
    "bowl",
    "box",
    "brick",
    "bunny",
    "comb",
    "creature",
    "cylinder",
    "disc",
    "dolphin",
    "extrude",
    "folded",
    "frog",
    "funnel",
    "gear",
    "hollow_ball",
    "hollow_brick",
    "letter",
    "outlines",
    "polygon",
    "propeller",
    "rectangle",
    "rope",
    "seahorse",
    "slit_array",
    "solids",
    "spike",
    "torus",
    "toys",
    "trampoline",
    "turned",
    "worm",
]
