"""Motions and starts from elsewhere: the points of an animation, frame by frame, or of a mesh at t = 0, as a rig or
another simulation has left them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.meshes import Surface
from pdvol.scene.checks import anything, ascending, finite, flag, instance, optional, positive, require
from pdvol.scene.element import Element
from pdvol.scene.placement import Placement
from pdvol.scene.values import Vector

USD_FILES = (".usd", ".usda", ".usdc", ".usdz")
ALEMBIC_FILES = (".abc",)
CACHE_FILES = (".pc2", *USD_FILES, *ALEMBIC_FILES)


@dataclass(frozen=True, eq=False, repr=False)
class PointCache(Element):
    """The points of an animation at its frames. In between they move straight and evenly; before the first frame and
    after the last they rest.

    It is the motion of a `Support` or of a `Deforming` obstacle. Vertices are matched to the nearest point of the
    animated mesh in its first frame, and follow that point on every level.

    Attributes
    ----------
    source : path of a PC2, USD or Alembic file, or an array (frames, points, d)
    times : (frames,) ascending times [s] of an array's frames, the first of them at `begin`
    fps : frames a second; of an array without `times`, of a PC2 file, or instead of the USD file's own. Alembic files
        have times in seconds.
    begin : time [s] of the first frame in the scene
    faces : triangles (f, 3), or edges (f, 2) in 2D, between the points; or the path of a mesh that has the points in
        the same order (not STL). USD and Alembic files have their own. Without faces vertices are matched to points.
    prim : path of the mesh in a USD or Alembic file, or of what its meshes lie below; needed where the file has several
    placement : of the points in the scene, at all frames; USD files are in metres before
    tolerance : how far a vertex may be from the animated mesh, as a fraction of the diagonal of its first frame
    """

    source: str | Path | np.ndarray | Sequence
    times: Vector = ()
    fps: float | None = None
    begin: float = 0.0
    faces: str | Path | Surface | np.ndarray | Sequence = ()
    prim: str = ""
    placement: Placement = Placement()
    tolerance: float = 0.05

    files = ("source", "faces")
    checks = {"times": anything, "fps": optional(positive), "begin": finite, "tolerance": positive}

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.faces, Surface):
            object.__setattr__(self, "faces", self.faces.triangles)
        if not isinstance(self.faces, (str, Path)):
            object.__setattr__(self, "faces", kept_array("PointCache.faces", self.faces, np.int64))
        if isinstance(self.source, (str, Path)):
            known = Path(self.source).suffix.lower()
            require(
                known in CACHE_FILES,
                f"PointCache.source = {str(self.source)!r} is of an unknown kind; there are {', '.join(CACHE_FILES)},"
                " or give an array (frames, points, d)",
            )
            require(self.times == (), "PointCache.times go with arrays; files have times of their own: give fps")
            require(
                known not in ALEMBIC_FILES or self.fps is None,
                f"PointCache: {self.source} has times in seconds; leave fps out",
            )
            require(
                known != ".pc2" or self.fps is not None,
                f"PointCache: {self.source} counts frames; give fps, the frames a second",
            )
        else:
            self._check_array()

    def _check_array(self) -> None:
        frames = kept_array("PointCache.source", self.source, None)
        require(
            frames.ndim == 3 and len(frames) > 0 and frames.shape[1] > 0 and frames.shape[2] in (2, 3),
            f"PointCache.source has the shape {frames.shape}; give (frames, points, 2 or 3)",
        )
        strange = np.flatnonzero(~np.isfinite(frames).all(axis=(1, 2)))
        require(
            len(strange) == 0, f"PointCache.source has NaN or infinity in frame {strange[0] if len(strange) else 0}"
        )
        object.__setattr__(self, "source", frames)
        given = (self.times != ()) + (self.fps is not None)
        require(given == 1, "PointCache: an array needs times, or fps, the frames a second: one of the two")
        if self.fps is None:
            require(
                len(self.times) == len(frames),
                f"PointCache has {len(self.times)} times and {len(frames)} frames; give as many",
            )
            ascending("PointCache.times", self.times)

    @property
    def label(self) -> str:
        """Its name in messages."""
        inside = f" at {self.prim}" if self.prim else ""
        return f"the point cache {self.source}{inside}" if isinstance(self.source, (str, Path)) else "the point cache"


@dataclass(frozen=True, repr=False)
class TakeOver(Element):
    """The velocity of a body that goes on where an animation ends: t = 0 is the animation's last frame, in which the
    body's shape is given.

    Velocities follow from the last three frames to second order in their distance, so that they are exact for free
    fall. With two frames they are differences.

    Attributes
    ----------
    cache : PointCache
    rigid : the velocity and spin of the animated mesh as a whole; else each vertex takes the velocity of the nearest
        point of that mesh
    """

    cache: PointCache
    rigid: bool = True

    checks = {"cache": instance(PointCache), "rigid": flag}


@dataclass(frozen=True, eq=False, repr=False)
class Posed(Element):
    """Vertices of a mesh at rest, and where they are at t = 0: the `start` of a `Body` on all of its levels.

    A level's vertices follow the cell that they lie in at rest, or that is nearest to them, by its linear map. So the
    mesh may be that of any level, or another one of the same shape. A stored state of an earlier run is given by
    `Posed(level.rest, level.cells, level.positions(step))`, and one of its bodies by a part of the cells.

    Attributes
    ----------
    rest : (n, d) [m]
        Rest positions in the scene, as placed.
    cells : (m, d + 1) triangles or tetrahedra; vertices of none are left out
    positions : (n, d) [m]
        Where the same vertices are at t = 0.
    tolerance : how far a vertex of a level may be from the mesh, as a fraction of its diagonal
    """

    rest: np.ndarray | Sequence
    cells: np.ndarray | Sequence
    positions: np.ndarray | Sequence
    tolerance: float = 0.05

    checks = {"tolerance": positive}

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, dtype in (("rest", None), ("positions", None), ("cells", np.int64)):
            object.__setattr__(self, name, kept_array(f"Posed.{name}", getattr(self, name), dtype))
        rest, cells, positions = np.asarray(self.rest), np.asarray(self.cells), np.asarray(self.positions)
        require(
            rest.ndim == 2 and rest.shape[1] in (2, 3) and rest.shape == positions.shape,
            f"Posed.rest and positions have the shapes {rest.shape} and {positions.shape}; give (n, 2) or (n, 3)",
        )
        require(
            bool(np.isfinite(rest).all() and np.isfinite(positions).all()),
            "Posed.rest or positions has NaN or infinity",
        )
        require(
            cells.ndim == 2 and len(cells) > 0 and cells.shape[1] == rest.shape[1] + 1,
            f"Posed.cells has the shape {cells.shape}; give (m, {rest.shape[1] + 1}), as triangles in 2D or tetrahedra",
        )
        require(
            bool(cells.min() >= 0 and cells.max() < len(rest)),
            f"Posed.cells names vertices from {cells.min()} to {cells.max()}; there are 0 to {len(rest) - 1}",
        )


def kept_array(name: str, values: Any, dtype: type | None) -> np.ndarray:
    """A copy of an array that nobody can write; single precision is kept."""
    try:
        array = np.asarray(values)
        whole = dtype is None or array.size == 0 or np.issubdtype(array.dtype, np.integer)
        array = array.astype(dtype or (array.dtype if array.dtype == np.float32 else np.float64))
    except (TypeError, ValueError) as error:
        require(False, f"{name} is no array of numbers ({' '.join(str(error).split())})")
    require(whole, f"{name} must be whole numbers, not {array.dtype}")
    array.setflags(write=False)
    return array
