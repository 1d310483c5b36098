"""Shape recipes: pure geometry, one function a shape, seeded. Nothing here knows of physics, MPI or PETSc."""

from .geometry import Outline, Solid, Surface

__all__ = ["Outline", "Solid", "Surface"]
