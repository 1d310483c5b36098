"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from . import outlines, solids, toys
from .ape import ape
from .creature import creature
from .dolphin import dolphin
from .donut import donut, donut_render, donut_texture
from .geometry import Outline, RenderSurface, Solid, Surface
from .grids import brick, hollow_ball
from .jellies import bunny, frog
from .outlines import comb, disc, extrude, folded, polygon, rectangle, rope, slit_array, spike
from .solids import ball, bar, box
from .toys import beach_ball, letter, propeller, trampoline, worm
from .turned import bowl, cylinder, funnel, torus, turned

__all__ = [
    "Outline",
    "RenderSurface",
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
    "donut",
    "donut_render",
    "donut_texture",
    "extrude",
    "folded",
    "frog",
    "funnel",
    "hollow_ball",
    "letter",
    "outlines",
    "polygon",
    "propeller",
    "rectangle",
    "rope",
    "slit_array",
    "solids",
    "spike",
    "torus",
    "toys",
    "trampoline",
    "turned",
    "worm",
]
