"""Reads meshes of USD and Alembic files, in a child process: animations, and shapes as they are at first."""

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.meshes import Surface
from pdvol.meshing.losses import counted, lost_labels, named
from pdvol.meshing.polygons import cut_faces
from pdvol.meshing.readers import read_in_child_process
from pdvol.scene.point_caches import ALEMBIC_FILES
from pdvol.studio.imports.alembic_caches import AlembicFile
from pdvol.studio.imports.usd_caches import UsdFile

MOST_CACHE_BYTES = 4_000_000_000  # of a file's points at all frames: they are kept in memory


SceneFile = AlembicFile | UsdFile
"""An open file, with the `names` of its meshes, of which each instance is one, the `rate` of its times in a second, how
messages write a time (`unit`), and lines on what is not read (`lost`). Of each mesh it has whether pictures show it at
first (`drawn`), the `times` at which its points or place are given, which are asked for first, none where it rests,
its `points` (n, 3) [m] at a time, or at the first one, its `faces` (corners of each polygon, corners of all, whether
these go clockwise as seen from outside), and the names of `groups` of its faces.
"""
READERS: dict[str, tuple[Callable[[Path], SceneFile], str, str]] = {
    "Alembic": (AlembicFile, "alembic3d.AbcGeom", "alembic3d"),
    "USD": (UsdFile, "pxr.UsdGeom", "usd-core"),
}
"""By kind of file: its class, the module that this needs, and the package that has it."""
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Times (k,) ascending [s], points (k, n, 3) [m], triangles (t, 3) int64."""


def read_animation(path: Path, prim: str = "", fps: float | None = None) -> Arrays:
    """The mesh that `prim` names, all below it, or the only one, at all times; one time where it rests. `fps` replaces
    the file's own rate.

    Raises
    ------
    InputError
        The file is damaged or has no such mesh, its points change in number, or the package that reads it is missing.
    """
    return read_in_child_process(path, _opened, _animation, prim, fps, loads=_reader(path)[2])


def read_still(path: Path) -> tuple[Surface, list[str]]:
    """All meshes of a file that pictures show, at the first of its times, as one surface, and notes.

    Raises InputError as `read_animation` does.
    """
    return read_in_child_process(path, _opened, _still, loads=_reader(path)[2])


def files_of_scene(path: Path) -> list[Path]:
    """Files besides the named one that a USD file reads its scene from: layers below, references, payloads, clips. None
    where the package that reads it is missing, or the file is damaged.
    """
    try:
        return read_in_child_process(path, _layers, loads=_reader(path)[2])
    except InputError:
        return []


def _layers(path: Path) -> list[Path]:
    from pxr import Tf, UsdUtils

    try:
        layers, _, _ = UsdUtils.ComputeAllDependencies(str(path))
    except Tf.ErrorException as error:
        raise InputError(f"{path}: {error}") from None
    return sorted({Path(layer.realPath) for layer in layers if layer.realPath} - {path.resolve(), path})


def _reader(path: Path) -> tuple[str, Callable[[Path], SceneFile], str]:
    """A file's kind and class, and the module that this needs; InputError where it is not installed."""
    kind = "Alembic" if path.suffix.lower() in ALEMBIC_FILES else "USD"
    reader, module, package = READERS[kind]
    if find_spec(module.partition(".")[0]) is None:
        raise InputError(f"{kind} files need the package {package}: pip install {package}")
    return kind, reader, module


def _animation(path: Path, file: SceneFile, prim: str, fps: float | None) -> Arrays:
    return _joined(path, file, _chosen(path, file, prim), fps or file.rate)[0]


def _still(path: Path, file: SceneFile) -> tuple[Surface, list[str]]:
    shown = _drawn(file, file.names)
    (_, points, triangles), moves = _joined(path, file, shown, first=True)
    notes = [
        *counted("meshes that are read as one surface", shown if len(shown) > 1 else []),
        *counted("meshes left out, which pictures do not show", [n for n in file.names if n not in set(shown)]),
        *lost_labels(list(dict.fromkeys(group for name in shown for group in file.groups(name)))),
        *file.lost,
        *(["it moves, and its first frame is read"] if moves else []),
    ]
    return Surface(points[0], triangles.astype(np.int32)), notes


def _opened(path: Path, use: Callable, *given: Any) -> Any:
    """The result of `use(path, file, *given)` of an open file that has meshes."""
    kind, reader, _ = _reader(path)
    try:
        file = reader(path)
        if not file.names:
            raise InputError("; ".join([f"{path}: it has no meshes", *file.lost, "export meshes"]))
        return use(path, file, *given)
    except (RuntimeError, ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: unreadable as {kind} ({reason}); export it again") from error


def _drawn(file: SceneFile, names: list[str]) -> list[str]:
    """Those of some meshes that pictures show, or all where they show none."""
    return [name for name in names if file.drawn(name)] or names


def _chosen(path: Path, file: SceneFile, wanted: str) -> list[str]:
    """The mesh that is wanted, or all drawn ones below the wanted place; the only one where nothing is wanted."""
    below = (f"{wanted.rstrip('/')}/", f"{wanted}[")
    chosen = _drawn(file, [name for name in file.names if wanted in ("", name) or name.startswith(below)])
    if not chosen or (len(chosen) > 1 and not wanted):
        what = f"no mesh {wanted!r}" if wanted else f"{len(chosen)} meshes"
        raise InputError(f"{path}: it has {what}; give PointCache(prim=...), one of {named(file.names)}")
    return chosen


def _joined(
    path: Path, file: SceneFile, names: Sequence[str], rate: float = 1.0, first: bool = False
) -> tuple[Arrays, bool]:
    """Some meshes as one, polygons cut in the first frame, at all times at which one of them is given, of which `rate`
    are a second, or at the `first` alone; and whether there are several times.
    """
    given = sorted(set().union(*map(file.times, names)))
    times: list[float | None] = [*given[: 1 if first else None]] or [None]
    sizes = [len(file.points(name, times[0])) for name in names]
    if 24 * sum(sizes) * len(times) > MOST_CACHE_BYTES:
        raise InputError(f"{path}: {sum(sizes):,} points at {len(times):,} times are too many; export fewer frames")
    points = np.empty((len(times), sum(sizes), 3))
    polygons: list[list[int]] = []
    for name, size, end in zip(names, sizes, np.cumsum(sizes), strict=True):
        where = f"{path}: the mesh {name}"
        if not size:
            raise InputError(f"{where} has no points")
        for k, time in enumerate(times):
            part = file.points(name, time)
            if len(part) != size:
                raise InputError(
                    f"{where} has {len(part):,} points at {file.unit.format(time)} and {size:,} before; only points"
                    " that stay the same can be followed"
                )
            points[k, end - size : end] = part
        counts, corners, clockwise = file.faces(name)
        fits = (counts >= 0).all() and corners.size == counts.sum()
        if not fits or (corners.size and not 0 <= corners.min() <= corners.max() < size):
            raise InputError(f"{where}: its faces do not fit its points; export it again")
        parts = np.split(corners + (end - size), np.cumsum(counts)[:-1])
        polygons += [list(map(int, part[:: -1 if clockwise else 1])) for part in parts if len(part) > 2]
    return (np.array([time or 0.0 for time in times]) / rate, points, cut_faces(points[0], polygons)), len(given) > 1
