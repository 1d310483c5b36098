"""Reads point caches: PC2 files, meshes of USD and Alembic files, and arrays.

A PC2 file begins with 32 bytes: `POINTCACHE2` and a zero, the version (int32, 1), the number of points (int32), the
first frame (float32), the frames from one sample to the next (float32), and the number of samples (int32). Three
float32 coordinates of each point follow, sample by sample. All are little-endian.
"""

import struct
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.meshes import Outline, Surface
from pdvol.meshing.file_kinds import no_file
from pdvol.meshing.readers import read_numbered
from pdvol.meshing.validate import outline_edges
from pdvol.registry import STUDIO
from pdvol.scene import Placement, PointCache

PC2_HEADER = struct.Struct("<12siiffi")
CACHES_KEPT = 8  # read caches that are kept: each level and each support asks for them


@dataclass(frozen=True, eq=False)
class Frames:
    """The points of an animation at its frames, in the scene.

    Its `times` (k,) ascend [s]. `points` (k, n, d) are as the source has them, single or double precision; `placement`
    puts them into the scene. `faces` (f, 3) int64 are triangles in 3D, (f, 2) edges in 2D, none where the source has
    none.
    """

    times: np.ndarray
    points: np.ndarray
    faces: np.ndarray
    placement: Placement

    def frame(self, number: int) -> np.ndarray:
        """(n, d) float64 [m]: the points at a frame; -1 is the last one."""
        return self.placement(np.asarray(self.points[number], dtype=np.float64))

    def at(self, time: float, rows: np.ndarray) -> np.ndarray:
        """(r, d) float64 [m]: some of the points at `time` [s], straight between frames."""
        last = len(self.times) - 1
        k = min(max(int(np.searchsorted(self.times, time, side="right")) - 1, 0), last)
        found = self.points[k][rows].astype(np.float64)
        if k < last and time > self.times[k]:
            fraction = (time - self.times[k]) / (self.times[k + 1] - self.times[k])
            found = (1.0 - fraction) * found + fraction * self.points[k + 1][rows]
        return self.placement(found)


@lru_cache(maxsize=CACHES_KEPT)
def read_frames(cache: PointCache) -> Frames:
    """The frames of a point cache. Not collective. It raises InputError where the file is missing, truncated or
    damaged, or faces do not fit the points.
    """
    if not isinstance(cache.source, (str, Path)):
        points = np.asarray(cache.source)
        frames = cache.times if cache.fps is None else np.arange(len(points)) / cache.fps
        frames, faces = np.asarray(frames, dtype=float), np.zeros((0, points.shape[2]), dtype=np.int64)
    else:
        path = Path(cache.source).expanduser()
        if not path.is_file():
            raise InputError(no_file(path))
        try:
            pc2 = path.suffix.lower() == ".pc2"
            frames, points, faces = _pc2(path, cache) if pc2 else STUDIO["read_animation"](path, cache.prim, cache.fps)
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
        for number in range(len(points)):
            if not np.isfinite(points[number]).all():
                raise InputError(f"{cache.label} has NaN or infinity in frame {number}; export it again")
    given = _faces(cache, points)
    faces = given if len(given) else faces
    if faces.size and (faces.min() < 0 or faces.max() >= points.shape[1]):
        raise InputError(
            f"{cache.label} has {points.shape[1]:,} points, and its faces use number {faces.max():,}; give faces of the"
            " same mesh"
        )
    return Frames(cache.begin + frames - frames[0], points, faces, cache.placement)


def cached_surface(cache: PointCache, frame: int = 0) -> Surface | Outline:
    """A point cache's mesh at a frame, as a shape in the scene: the first frame is 0, the last one -1. In 2D points
    without edges are a closed outline in their order. It raises InputError where the cache cannot be read, there is no
    such frame, or its points have no faces.
    """
    frames = read_frames(cache)
    if not -len(frames.times) <= frame < len(frames.times):
        raise InputError(f"{cache.label} has no frame {frame}; it has {len(frames.times):,}")
    points = frames.frame(frame)
    if points.shape[1] == 2:
        return Outline(points)
    if len(frames.faces) == 0:
        raise InputError(f"{cache.label} has points without faces; give PointCache(faces=...), as the path of its mesh")
    return Surface(points, frames.faces.astype(np.int32))


def edges_or_faces(cache: PointCache, closed: bool) -> np.ndarray:
    """(f, d) int64: triangles of a cache, or edges in 2D, which join the points in order where it has none."""
    frames = read_frames(cache)
    if len(frames.faces) == 0 and frames.points.shape[2] == 2:
        return outline_edges(frames.points.shape[1], closed)
    return frames.faces


def _faces(cache: PointCache, points: np.ndarray) -> np.ndarray:
    """The faces that the scene gives."""
    faces: Any = cache.faces
    if isinstance(faces, (str, Path)):
        path, (vertices, faces) = faces, read_numbered(faces, "PointCache.faces")
        if len(vertices) != points.shape[1]:
            raise InputError(
                f"{path} has {len(vertices):,} vertices and {cache.label} {points.shape[1]:,} points; export both from"
                " the same mesh, with its vertices in order"
            )
    faces = np.asarray(faces, dtype=np.int64)
    if faces.size and (faces.ndim != 2 or faces.shape[1] != points.shape[2]):
        what = "edges (f, 2)" if points.shape[2] == 2 else "triangles (f, 3)"
        raise InputError(f"PointCache.faces has the shape {faces.shape}; give {what}")
    return faces.reshape(-1, points.shape[2])


def _pc2(path: Path, cache: PointCache) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times [s], points as a view of the file, no faces."""
    size = path.stat().st_size
    with path.open("rb") as file:
        start = file.read(PC2_HEADER.size)
    if len(start) < PC2_HEADER.size or not start.startswith(b"POINTCACHE2\0"):
        raise InputError(f"{path}: not a PC2 file; it begins otherwise: export the point cache again")
    _, version, count, _, rate, samples = PC2_HEADER.unpack(start)
    if version != 1:
        raise InputError(f"{path}: PC2 of version {version}, and only version 1 is known; export it again")
    if count < 1 or samples < 1 or not rate > 0.0:
        raise InputError(f"{path}: its header promises {count} points, {samples} samples, {rate:g} frames each")
    promised = PC2_HEADER.size + 12 * count * samples
    if size < promised:
        raise InputError(f"{path}: truncated, it promises {promised:,} bytes and holds {size:,}; export it again")
    points = np.memmap(path, "<f4", "r", PC2_HEADER.size, (samples, count, 3))
    return np.arange(samples) * (rate / float(cache.fps or 1.0)), points, np.zeros((0, 3), dtype=np.int64)
