"""What a recipe returns: plain arrays with a name. Lengths are in metres."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


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


@dataclass(frozen=True, eq=False)
class RenderSurface:
    """A surface of polygons that is drawn and not simulated, with texture coordinates where it has any.

    Attributes
    ----------
    vertices : (n, 3) float64
    counts : (f,) int64
        How many corners each polygon has.
    corners : (sum of counts,) int64
        The corners of all polygons.
    uvs : (k, 2) float64
        Places in the texture, (0, 0) its lower left corner; none where the surface has no texture.
    uv_corners : (sum of counts,) int64
        The place in the texture of each corner; a vertex on a seam has several. None where there are no `uvs`.
    """

    vertices: np.ndarray
    counts: np.ndarray
    corners: np.ndarray
    uvs: np.ndarray
    uv_corners: np.ndarray

    @classmethod
    def of(
        cls,
        vertices: ArrayLike,
        faces: Sequence[Sequence[int]] | np.ndarray,
        uvs: ArrayLike = (),
        face_uvs: Sequence[Sequence[int]] | np.ndarray | None = None,
    ) -> "RenderSurface":
        """From vertices (n, 3), the corners of each face, and, if it has a texture, places (k, 2) and the place of each
        corner of each face; those of the vertices where `face_uvs` is None.
        """
        flat = lambda rows: np.array([int(i) for row in rows for i in row], dtype=np.int64)
        places = np.asarray(uvs, dtype=np.float64).reshape(-1, 2)
        corners = flat(faces)
        return cls(
            np.asarray(vertices, dtype=np.float64),
            np.array([len(face) for face in faces], dtype=np.int64),
            corners,
            places,
            (corners if face_uvs is None else flat(face_uvs)) if len(places) else np.zeros(0, dtype=np.int64),
        )

    @property
    def fans(self) -> np.ndarray:
        """(m, 3) int64, into `corners` and `uv_corners`: each polygon as triangles about its first corner."""
        parts = self.counts - 2
        start = np.repeat(np.cumsum(self.counts) - self.counts, parts)
        inner = np.arange(len(start)) - np.repeat(np.cumsum(parts) - parts, parts)
        return np.column_stack([start, start + inner + 1, start + inner + 2])

    @property
    def triangles(self) -> np.ndarray:
        """(m, 3) int64, into `vertices`: those of `fans`."""
        return self.corners[self.fans]

    def __repr__(self) -> str:
        shapes = f"vertices={np.shape(self.vertices)}, faces={len(self.counts)}, uvs={np.shape(self.uvs)}"
        return f"RenderSurface({shapes})"
