"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from . import outlines, solids
from .ape import ape
from .creature import creature
from .dolphin import dolphin
from .geometry import Outline, Solid, Surface
from .grids import brick
from .outlines import comb, disc, extrude, folded, polygon, rectangle, rope, slit_array, spike
from .solids import ball, bar, box
from .turned import cylinder, funnel, torus, turned

__all__ = [
    "Outline",
    "Solid",
    "Surface",
    "ape",
    "ball",
    "bar",
    "box",
    "brick",
    "comb",
    "creature",
    "cylinder",
    "disc",
    "dolphin",
    "extrude",
    "folded",
    "funnel",
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
