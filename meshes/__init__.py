"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from . import outlines, solids
from .creature import creature
from .geometry import Outline, Solid, Surface
from .outlines import comb, disc, extrude, folded, polygon, rectangle, rope, slit_array, spike
from .solids import ball, bar, box

__all__ = [
    "Outline",
    "Solid",
    "Surface",
    "ball",
    "bar",
    "box",
    "comb",
    "creature",
    "disc",
    "extrude",
    "folded",
    "outlines",
    "polygon",
    "rectangle",
    "rope",
    "slit_array",
    "solids",
    "spike",
]
