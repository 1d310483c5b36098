"""Cut-aways: a plane across an axis takes away what lies between it and the camera."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pdvol.errors import InputError

_AXES = "xyz"


@dataclass(frozen=True)
class Cut:
    """A plane across an axis.

    Attributes
    ----------
    axis : 0, 1 or 2
    place : of the plane along the axis [m]
    names : bodies and obstacles that it cuts; all bodies where empty
    """

    axis: int
    place: float
    names: tuple[str, ...] = ()

    def through(self, name: str, body: bool) -> bool:
        """Whether it cuts the body or obstacle of this name."""
        return name in self.names if self.names else body

    def solid(self, points: np.ndarray, cells: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points (n, 3) [m] and triangles of the surface of what is left of tetrahedra (m, 4), the section included.

        Parameters
        ----------
        points : (k, 3) [m]
        towards : (3,) from the scene to the camera
        """
        import pyvista as pv  # takes a second to load, and views are read without it

        return self._left(pv.UnstructuredGrid({pv.CellType.TETRA: cells}, points), towards)

    def surface(self, points: np.ndarray, triangles: np.ndarray, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What is left of a surface, open where it is cut; arguments as those of `solid`."""
        import pyvista as pv

        return self._left(pv.PolyData.from_regular_faces(points, triangles), towards)

    def left(self, shape: Any, towards: np.ndarray) -> Any:
        """What is left of a shape of pyvista, with its data on points and cells."""
        normal, origin = np.eye(3)[self.axis], np.zeros(3)
        origin[self.axis] = self.place
        return shape.clip(normal=normal, origin=origin, invert=bool(towards[self.axis] > 0.0))

    def _left(self, shape: Any, towards: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        left = self.left(shape, towards)
        if left.n_cells == 0:
            return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
        skin = left.extract_surface(algorithm="dataset_surface").triangulate().clean()
        return np.asarray(skin.points, dtype=float), skin.regular_faces


def read_cut(text: str, bodies: Sequence[str], obstacles: Sequence[str]) -> Cut | None:
    """The cut that `--cut` names: `z=0.1`, or `z=0.1:cube,bowl` for these bodies and obstacles alone; None for an
    empty text.

    Raises
    ------
    InputError
        The text is another one, or no body or obstacle has such a name.
    """
    if not text:
        return None
    plane, colon, rest = text.partition(":")
    axis, equals, place = plane.partition("=")
    try:
        at = float(place)
    except ValueError:
        at = float("nan")
    names = tuple(name for name in rest.split(",") if name)
    if axis not in tuple(_AXES) or not equals or not np.isfinite(at) or (colon and not names):
        raise InputError(f"--cut: {text!r} is no plane; give an axis and a place in metres, as z=0.1 or z=0.1:BODY,...")
    for name in names:
        if name not in (*bodies, *obstacles):
            known = ", ".join([*bodies, *obstacles])
            raise InputError(f"--cut: {name!r} is neither a body nor an obstacle; there are {known}")
    return Cut(_AXES.index(axis), at, names)
