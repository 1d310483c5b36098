"""What a recipe returns: plain arrays with a name. Lengths are in metres."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class Outline:
    """A closed 2D polygon, anticlockwise, without repeating its first point.

    Attributes
    ----------
    points : (n, 2) float64
    """

    points: np.ndarray

    def __repr__(self) -> str:
        return f"Outline(points={np.shape(self.points)})"


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle surface with outward normals.

    Attributes
    ----------
    vertices : (n, 3) float64
    triangles : (m, 3) int32
    """

    vertices: np.ndarray
    triangles: np.ndarray

    def __repr__(self) -> str:
        return f"Surface(vertices={np.shape(self.vertices)}, triangles={np.shape(self.triangles)})"


@dataclass(frozen=True, eq=False)
class Solid:
    """A mesh of positively oriented simplices: triangles in 2D, tetrahedra in 3D.

    Attributes
    ----------
    vertices : (n, d) float64
    cells : (m, d + 1) int32
    regions : (m,) int32
        A label per cell, 0 where the input has none.
    """

    vertices: np.ndarray
    cells: np.ndarray
    regions: np.ndarray

    def __repr__(self) -> str:
        return f"Solid(vertices={np.shape(self.vertices)}, cells={np.shape(self.cells)})"
