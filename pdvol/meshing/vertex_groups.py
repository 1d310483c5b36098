"""Parts of a body that are marked on a surface: a weight at each of its vertices, as modelling software paints them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import igl
import numpy as np
from scipy.spatial import cKDTree

from pdvol.errors import InputError
from pdvol.geometry.boundary_search import nearest_points
from pdvol.geometry.crossings import edges_of
from pdvol.meshes import Surface
from pdvol.meshing.readers import read_numbered
from pdvol.scene import Placement
from pdvol.scene.checks import flag, positive
from pdvol.scene.element import Element
from pdvol.scene.point_caches import kept_array

MARKED = 0.5  # weight from which on a vertex belongs to the group
EDGE_SAMPLES = 2  # points on a marked edge for each length of the reach: between two of them nothing is out of reach


@dataclass(frozen=True, eq=False, repr=False)
class VertexGroup(Element):
    """A part of a body, by weights of a surface's vertices: the `where` of a `Support`, a `Region` or a load. It means
    the same on every level, whose vertices are other ones.

    Faces, edges and vertices of the surface are marked where all of their corners have a weight of at least 0.5.

    Attributes
    ----------
    surface : path of a surface or a volume mesh whose file numbers its vertices (not STL), or a `Surface`
    weights : (n,) 0 to 1, a weight for each vertex in its order; or the path of a text file with one on each line
    reach : points belong to the group up to this distance from what is marked, as a fraction of the surface's diagonal
    filled : instead, points at any depth belong to it whose nearest point of the surface has a weight of at least 0.5,
        as the parts of a body do that are made of something else
    placement : of the surface in the scene
    """

    surface: str | Path | Surface
    weights: str | Path | np.ndarray | Sequence
    reach: float = 0.05
    filled: bool = False
    placement: Placement = Placement()
    files = ("surface", "weights")
    checks = {"reach": positive, "filled": flag}

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.weights, (str, Path)):
            object.__setattr__(self, "weights", kept_array("VertexGroup.weights", self.weights, None))

    def __call__(self, X: np.ndarray) -> np.ndarray:
        """(n,) bool: which points (n, 3) [m] belong to the group.

        Raises
        ------
        InputError
            A file is missing or unreadable, the weights do not fit the surface, or nothing is marked.
        """
        vertices, triangles, weights = self._arrays
        if self.filled:
            nearest, places = nearest_points(vertices, triangles, X)
            corners = (np.ascontiguousarray(corner) for corner in vertices[triangles[nearest]].transpose(1, 0, 2))
            shares = igl.barycentric_coordinates(np.ascontiguousarray(places), *corners)
            shares = np.where(np.isfinite(shares), shares, 1.0 / 3.0)  # of a triangle without area
            return (shares * weights[triangles[nearest]]).sum(axis=1) >= MARKED
        marked = weights >= MARKED
        reach = self.reach * float(np.linalg.norm(np.ptp(vertices, axis=0)))
        held = cKDTree(_marked_points(vertices, triangles, marked, reach / EDGE_SAMPLES)).query(X)[0] <= reach
        whole = triangles[marked[triangles].all(axis=1)]
        if len(whole):
            held |= np.linalg.norm(X - nearest_points(vertices, whole, X)[1], axis=1) <= reach
        return held

    @cached_property
    def _arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Vertices [m] in the scene, triangles, weights."""
        vertices, triangles = _surface(self.surface)
        weights = _weights(self.weights)
        whose = f"VertexGroup.weights ({self.weights})" if isinstance(self.weights, (str, Path)) else "the weights"
        if weights.shape != (len(vertices),):
            raise InputError(f"{whose}: {weights.size:,} weights for {len(vertices):,} vertices; give one for each")
        if not np.isfinite(weights).all():
            raise InputError(f"{whose}: NaN or infinity; give weights from 0 to 1")
        if not (weights >= MARKED).any():
            raise InputError(f"{whose}: no vertex has a weight of {MARKED} or more, so the group is empty")
        return self.placement(vertices), triangles, weights


def _surface(surface: str | Path | Surface) -> tuple[np.ndarray, np.ndarray]:
    if isinstance(surface, Surface):
        return np.asarray(surface.vertices, dtype=float), np.asarray(surface.triangles, dtype=np.int64)
    vertices, triangles = read_numbered(surface, "VertexGroup.surface")
    if vertices.shape[1] != 3:
        raise InputError(f"VertexGroup.surface: {surface} is flat; give a surface in 3D")
    return vertices, triangles


def _weights(weights: str | Path | np.ndarray | Sequence) -> np.ndarray:
    if not isinstance(weights, (str, Path)):
        return np.asarray(weights, dtype=float)
    path = Path(weights).expanduser()
    try:
        return np.array([float(word) for word in path.read_text().split()])
    except FileNotFoundError as error:
        raise InputError(f"{path}: there is no such file; check VertexGroup.weights") from error
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: unreadable ({' '.join(str(error).split())}); write one number on a line") from error


def _marked_points(vertices: np.ndarray, triangles: np.ndarray, marked: np.ndarray, spacing: float) -> np.ndarray:
    """Marked vertices, and points on marked edges no further than `spacing` [m] from each other."""
    edges = edges_of(triangles)
    found = [vertices[marked]]
    for a, b in vertices[edges[marked[edges].all(axis=1)]]:
        inner = int(np.linalg.norm(b - a) / spacing)
        found.append(a + (b - a) * np.linspace(0.0, 1.0, inner + 2)[1:-1, None])
    return np.concatenate(found)
