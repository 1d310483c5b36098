"""What files of animated meshes have in common: which of a file's meshes is meant, and its polygons as triangles."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pdvol.errors import InputError
from pdvol.meshing.polygons import cut_faces

MOST_CACHE_BYTES = 4_000_000_000  # of a file's points at all frames: they are kept in memory
MOST_NAMED = 8  # meshes of a file that a message names


@dataclass(frozen=True, eq=False)
class AnimatedMesh:
    """A mesh as a file has it.

    Attributes
    ----------
    times : (k,) ascending [s]
    points : (k, n, 3) [m]
    counts, corners : (f,) and (sum of counts,) int64
        How many corners each polygon has, and the corners of all.
    """

    times: np.ndarray
    points: np.ndarray
    counts: np.ndarray
    corners: np.ndarray

    def triangles(self, where: str) -> np.ndarray:
        """(t, 3) int64: its polygons, cut in the first frame.

        Raises
        ------
        InputError
            The polygons do not fit the points; the message begins with `where`.
        """
        corners, count = self.corners, self.points.shape[1]
        if corners.size != self.counts.sum() or (corners.size and not 0 <= corners.min() <= corners.max() < count):
            raise InputError(f"{where}: its faces do not fit its points; export it again")
        polygons = [list(map(int, part)) for part in np.split(corners, np.cumsum(self.counts)[:-1]) if len(part) > 2]
        return cut_faces(self.points[0], polygons)


def chosen_mesh(path: Path, names: Sequence[str], wanted: str) -> int:
    """The number of the mesh of a file that is wanted, or of the only one where nothing is wanted.

    Raises
    ------
    InputError
        There is no such mesh, or several.
    """
    chosen = [number for number, name in enumerate(names) if wanted in ("", name)]
    if len(chosen) != 1:
        found = f"no mesh {wanted!r}" if wanted else f"{len(names)} meshes"
        there = ", ".join(names[:MOST_NAMED]) or "none"
        raise InputError(f"{path}: it has {found}; give PointCache(prim=...), one of {there}")
    return chosen[0]


def require_samples(where: str, count: int, times: Sequence[float] | np.ndarray) -> None:
    """InputError where a mesh does not move, has no points, or has too many at all times for the memory."""
    if len(times) == 0:
        raise InputError(f"{where} does not move; it has no time samples")
    if count == 0:
        raise InputError(f"{where} has no points")
    if 24 * count * len(times) > MOST_CACHE_BYTES:
        raise InputError(f"{where}: {count:,} points at {len(times):,} times are too many; export fewer frames")


def require_same_count(where: str, count: int, first: int, when: str) -> None:
    """InputError where a mesh has another number of points than at first."""
    if count != first:
        raise InputError(
            f"{where} has {count:,} points at {when} and {first:,} before; only points that stay the same can be"
            " followed"
        )
