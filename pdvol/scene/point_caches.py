"""Motions from elsewhere: the points of an animation, frame by frame, as a rig or another simulation has left them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.meshes import Surface
from pdvol.scene.checks import finite, keep_plain, positive, require
from pdvol.scene.motions import Vector
from pdvol.scene.placement import Placement
from pdvol.scene.representation import one_line

USD_FILES = (".usd", ".usda", ".usdc", ".usdz")
ALEMBIC_FILES = (".abc",)
CACHE_FILES = (".pc2", *USD_FILES, *ALEMBIC_FILES)


@dataclass(frozen=True, eq=False)
class PointCache:
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
    faces : triangles (f, 3), or edges (f, 2) in 2D, between the points; or the path of an OBJ file that has the points
        in the same order. USD and Alembic files have their own. Without faces vertices are matched to points.
    prim : path of the mesh in a USD or Alembic file; needed where the file has several
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "times", "fps", "begin", "tolerance")
        finite("PointCache.begin", self.begin)
        positive("PointCache.tolerance", self.tolerance)
        if self.fps is not None:
            positive("PointCache.fps", self.fps)
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
            for time in self.times:
                finite("PointCache.times", time)
            require(
                len(self.times) == len(frames),
                f"PointCache has {len(self.times)} times and {len(frames)} frames; give as many",
            )
            ascending = all(a < b for a, b in zip(self.times, self.times[1:], strict=False))
            require(ascending, "PointCache.times must ascend")

    @property
    def label(self) -> str:
        """Its name in messages."""
        inside = f" at {self.prim}" if self.prim else ""
        named = isinstance(self.source, (str, Path))
        return f"the point cache {self.source}{inside}" if named else "the point cache"


@dataclass(frozen=True)
class TakeOver:
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
    __repr__ = one_line

    def __post_init__(self) -> None:
        keep_plain(self, "rigid")
        require(
            isinstance(self.cache, PointCache),
            f"TakeOver.cache must be a PointCache, not {type(self.cache).__name__}",
        )
        require(isinstance(self.rigid, bool), f"TakeOver.rigid = {self.rigid!r} must be True or False")


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
