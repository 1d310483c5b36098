"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from . import outlines, solids, toys
from .ape import ape
from .contours import gear, seahorse
from .creature import creature
from .dolphin import dolphin
from .donut import donut, donut_render, donut_texture
from .geometry import Outline, RenderSurface, Solid, Surface
from .gnome import gnome, letter_block
from .grids import brick, hollow_ball, hollow_brick
from .jellies import bunny, frog
from .outlines import comb, disc, extrude, folded, polygon, rectangle, rope, slit_array, spike
from .sea import leaf_sheep, sea_mushroom, stone
from .slices import bunny_outline, bunny_slice
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
    "bunny_outline",
    "bunny_slice",
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
    "gear",
    "gnome",
    "hollow_ball",
    "hollow_brick",
    "leaf_sheep",
    "letter",
    "letter_block",
    "outlines",
    "polygon",
    "propeller",
    "rectangle",
    "rope",
    "sea_mushroom",
    "seahorse",
    "slit_array",
    "solids",
    "spike",
    "stone",
    "torus",
    "toys",
    "trampoline",
    "turned",
    "worm",
]
