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

    def left(self, shape: Any, towards: np.ndarray) -> Any:
        """The skin of what is left of a shape of pyvista: a solid is closed by the section, a surface is open there.

        Parameters
        ----------
        towards : (3,) from the scene to the camera
        """
        normal = np.eye(3)[self.axis]
        return skin(shape.clip(normal=normal, origin=self.place * normal, invert=bool(towards[self.axis] > 0.0)))


def skin(shape: Any) -> Any:
    """The boundary of a shape of pyvista in triangles, with its data on cells."""
    return shape.extract_surface(algorithm="dataset_surface").triangulate().clean()


def triangles(surface: Any) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) [m] and triangles (m, 3) of a surface of pyvista, which may be empty."""
    faces = surface.regular_faces if surface.n_cells else np.empty((0, 3), dtype=np.int64)
    return np.asarray(surface.points, dtype=float).reshape(-1, 3), faces


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
