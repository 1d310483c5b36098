"""Meshes in the files of other software's scenes: which of them are meant, and their points at some times."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from pdvol.errors import InputError
from pdvol.meshing.losses import named
from pdvol.meshing.polygons import cut_faces

MOST_CACHE_BYTES = 4_000_000_000  # of a file's points at all frames: they are kept in memory


class SceneFile(Protocol):
    """An open file. Each instance of a mesh counts as a mesh, and has a name: its place in the file.

    Attributes
    ----------
    path : Path
    names : of the meshes
    rate : units of its times in a second
    unit : how messages write a time
    lost : what is not read, in lines
    """

    path: Path
    names: list[str]
    rate: float
    unit: str
    lost: list[str]

    def drawn(self, name: str) -> bool:
        """Whether pictures show the mesh at first."""

    def times(self, name: str) -> Iterable[float]:
        """When its points, its place or that of what it hangs on are given; none where it rests."""

    def points(self, name: str, time: float | None) -> np.ndarray:
        """(n, 3) [m] in the file's space, at a time, or at the first one."""

    def faces(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        """The number of corners of each polygon, and the corners of all (int64), counter-clockwise from outside."""

    def groups(self, name: str) -> Iterable[str]:
        """Names of the groups of its faces."""


@dataclass(frozen=True, eq=False)
class AnimatedMesh:
    """Meshes as a file has them.

    Attributes
    ----------
    times : (k,) ascending [s]
    points : (k, n, 3) [m]
    counts, corners : (f,) and (sum of counts,) int64
        How many corners each polygon has, and the corners of all.
    moves : whether the file has them at several times
    """

    times: np.ndarray
    points: np.ndarray
    counts: np.ndarray
    corners: np.ndarray
    moves: bool

    def triangles(self) -> np.ndarray:
        """(t, 3) int64: its polygons, cut in the first frame."""
        parts = np.split(self.corners, np.cumsum(self.counts)[:-1])
        return cut_faces(self.points[0], [list(map(int, part)) for part in parts if len(part) > 2])


def chosen_meshes(file: SceneFile, wanted: str) -> list[str]:
    """The mesh of a file that is wanted, or all below the wanted place; the only one where nothing is wanted.

    Meshes that pictures do not show are left out where others are shown.

    Raises
    ------
    InputError
        There is no such mesh, or several where nothing is wanted.
    """
    require_meshes(file)
    below = (f"{wanted.rstrip('/')}/", f"{wanted}[")
    found = [name for name in file.names if wanted in ("", name) or name.startswith(below)]
    chosen = [name for name in found if file.drawn(name)] or found
    if not chosen or (len(chosen) > 1 and not wanted):
        what = f"no mesh {wanted!r}" if wanted else f"{len(chosen)} meshes"
        raise InputError(f"{file.path}: it has {what}; give PointCache(prim=...), one of {named(file.names)}")
    return chosen


def require_meshes(file: SceneFile) -> None:
    """InputError where a file has no meshes."""
    if not file.names:
        raise InputError("; ".join([f"{file.path}: it has no meshes", *file.lost, "export meshes"]))


def joined_meshes(file: SceneFile, names: Sequence[str], rate: float = 1.0, first: bool = False) -> AnimatedMesh:
    """Some meshes of a file as one, at all times at which one of them is given, of which `rate` are a second; or at the
    first of them alone.

    Raises
    ------
    InputError
        A mesh has no points, changes their number, or has faces that do not fit; or all are too many for the memory.
    """
    given = sorted(set().union(*map(file.times, names)))
    times: list[float | None] = [*given[: 1 if first else None]] or [None]
    sizes = [len(file.points(name, times[0])) for name in names]
    if 24 * sum(sizes) * len(times) > MOST_CACHE_BYTES:
        raise InputError(
            f"{file.path}: {sum(sizes):,} points of {named(names)} at {len(times):,} times are too many; export fewer"
            " frames"
        )
    points = []
    for time in times:
        now = [file.points(name, time) for name in names]
        for name, part, size in zip(names, now, sizes, strict=True):
            if not size:
                raise InputError(f"{file.path}: the mesh {name} has no points")
            if len(part) != size:
                raise InputError(
                    f"{file.path}: the mesh {name} has {len(part):,} points at {file.unit.format(time)} and {size:,}"
                    " before; only points that stay the same can be followed"
                )
        points.append(np.concatenate(now))
    counts, corners = [], []
    for name, size, start in zip(names, sizes, np.cumsum([0, *sizes]), strict=False):
        count, corner = file.faces(name)
        fits = (count >= 0).all() and corner.size == count.sum()
        if not fits or (corner.size and not 0 <= corner.min() <= corner.max() < size):
            raise InputError(f"{file.path}: the mesh {name}: its faces do not fit its points; export it again")
        counts.append(count)
        corners.append(corner + start)
    moments = np.array([time or 0.0 for time in times]) / rate
    return AnimatedMesh(moments, np.array(points), np.concatenate(counts), np.concatenate(corners), len(given) > 1)


def turned_round(counts: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The corners of polygons in the other order; as they are where they do not fit."""
    if (counts < 0).any() or corners.size != counts.sum():
        return corners
    ends = np.cumsum(counts)
    return corners[np.repeat(2 * ends - counts - 1, counts) - np.arange(len(corners))]
