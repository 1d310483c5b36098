"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from . import outlines, solids
from .donut import donut, donut_render, donut_texture
from .geometry import Outline, RenderSurface, Solid, Surface
from .grids import brick, hollow_ball, hollow_brick
from .jellies import bunny, creature, frog
from .outlines import comb, disc, extrude, folded, polygon, rectangle, rope, slit_array, spike
from .solids import ball, bar, box
from .turned import bowl, cylinder, funnel, torus, turned

__all__ = [
    "Outline",
    "RenderSurface",
    "Solid",
    "Surface",
    "ball",
    "bar",
    "bowl",
    "box",
    "brick",
    "bunny",
    "comb",
    "creature",
    "cylinder",
    "disc",
    "donut",
    "donut_render",
    "donut_texture",
    "extrude",
    "folded",
    "frog",
    "funnel",
    "hollow_ball",
    "hollow_brick",
    "outlines",
    "polygon",
    "rectangle",
    "rope",
    "slit_array",
    "solids",
    "spike",
    "torus",
    "turned",
]
