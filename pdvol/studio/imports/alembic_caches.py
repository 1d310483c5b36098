"""Reads the animated meshes of Alembic files: points, and the places of what they hang on.

Positions and places may be sampled at times of their own. Between samples both are interpolated evenly. Alembic has no
units, and corners go clockwise around a face as seen from outside.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.meshing.readers import read_in_child_process
from pdvol.studio.imports.animated_meshes import AnimatedMesh, chosen_mesh, require_same_count, require_samples

TIME_DIGITS = 9  # of times in seconds: samples of two objects at the same time may differ by rounding


def read_alembic(path: Path, prim: str = "") -> tuple[AnimatedMesh, str]:
    """The mesh that `prim` names by its place in the file, or the only one, and how messages name it.

    Raises
    ------
    InputError
        The file is damaged, has no such mesh, or its points do not move or change in number; alembic3d is missing.
    """
    try:
        import alembic3d.AbcGeom  # noqa: F401
    except ImportError as error:
        raise InputError(
            "Alembic files need the package alembic3d: pip install alembic3d; export PC2 otherwise"
        ) from error
    found = read_in_child_process(path, _read, prim)
    where = f"{path}: the mesh {found['name']}"
    tracks = [(found[f"times_{i}"], found[f"track_{i}"]) for i in range(int(found["tracks"]))]
    moving = [times.round(TIME_DIGITS) for times, _ in tracks if len(times) > 1]
    times = np.unique(np.concatenate(moving)) if moving else np.zeros(0)
    stored, places = tracks[0], tracks[1:]
    require_samples(where, stored[1].shape[1], times)
    points = np.empty((len(times), stored[1].shape[1], 3))
    for k, time in enumerate(times):
        matrix = np.eye(4)
        for place in places:
            matrix = matrix @ _between(*place, time)
        points[k] = _between(*stored, time) @ matrix[:3, :3] + matrix[3, :3]
    return AnimatedMesh(times, points, found["counts"], found["corners"]), where


def _read(path: Path, prim: str) -> dict[str, np.ndarray]:
    """Faces and tracks of a mesh: times (k,) [s] and values (k, ...) of its points, then of the matrices of what it
    hangs on, the nearest first.
    """
    from alembic3d.Abc import IArchive

    try:
        archive = IArchive(str(path))
        meshes = {thing.getFullName(): (thing, kind) for thing in _things(archive.getTop()) if (kind := _mesh(thing))}
        names = list(meshes)
        name = names[chosen_mesh(path, names, prim)]
        return {"name": np.array(name), **_samples(*meshes[name], f"{path}: the mesh {name}")}
    except (RuntimeError, ValueError, IndexError) as error:
        if isinstance(error, InputError):
            raise
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"{path}: unreadable as Alembic ({reason}); export it again") from error


def _things(top: Any) -> Iterator[Any]:
    """All objects below one."""
    waiting = [top]
    while waiting:
        thing = waiting.pop()
        yield thing
        waiting += [thing.getChild(i) for i in reversed(range(thing.getNumChildren()))]


def _mesh(thing: Any) -> Any:
    """The class of a mesh's schema: of polygons, or of a subdivision surface; None of anything else."""
    from alembic3d.AbcGeom import IPolyMesh, ISubD

    return next((kind for kind in (IPolyMesh, ISubD) if kind.matches(thing.getHeader())), None)


def _samples(thing: Any, kind: Any, where: str) -> dict[str, np.ndarray]:
    schema = kind(thing.getParent(), thing.getName()).getSchema()
    positions = schema.getPositionsProperty()
    times = _times(positions, 1 if positions.isConstant() else positions.getNumSamples())
    first = len(positions.getValue(0)) if positions.getNumSamples() else 0
    points = np.empty((len(times), first, 3), dtype=np.float32)
    for number, time in enumerate(times):
        local = np.array(memoryview(positions.getValue(number))).reshape(-1, 3)
        require_same_count(where, len(local), first, f"{time:g} s")
        points[number] = local
    counts = np.array(memoryview(schema.getFaceCountsProperty().getValue(0)), dtype=np.int64)
    corners = np.array(memoryview(schema.getFaceIndicesProperty().getValue(0)), dtype=np.int64)
    if corners.size == counts.sum() and (counts >= 0).all():
        corners = np.concatenate([part[::-1] for part in np.split(corners, np.cumsum(counts)[:-1])])
    found = {"counts": counts, "corners": corners}
    tracks = [(times, points), *_places(thing)]
    for i, (at, values) in enumerate(tracks):
        found |= {f"times_{i}": at, f"track_{i}": values}
    return {**found, "tracks": np.array(len(tracks))}


def _places(thing: Any) -> list[tuple[np.ndarray, np.ndarray]]:
    """Times (k,) [s] and matrices (k, 4, 4), which multiply rows from the right, of what a mesh hangs on."""
    from alembic3d.Abc import ISampleSelector
    from alembic3d.AbcGeom import IXform

    found, above = [], thing.getParent()
    while above.valid() and above.getParent().valid():
        if IXform.matches(above.getHeader()):
            schema = IXform(above.getParent(), above.getName()).getSchema()
            times = _times(schema, schema.getNumSamples())
            samples = [schema.getValue(ISampleSelector(float(time))) for time in times]
            found.append((times, np.array([np.array(sample.getMatrix()) for sample in samples]).reshape(-1, 4, 4)))
            if samples and not samples[0].getInheritsXforms():
                break
        above = above.getParent()
    return [(times, matrices) for times, matrices in found if len(times)]


def _times(sampled: Any, count: int) -> np.ndarray:
    """(count,) [s]: when a property or a schema is sampled."""
    sampling = sampled.getTimeSampling()
    return np.array([sampling.getSampleTime(number) for number in range(count)])


def _between(times: np.ndarray, values: np.ndarray, time: float) -> np.ndarray:
    """One of the values at `times`, or what lies evenly between two; the first and the last hold on."""
    k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1))
    if k == len(times) - 1 or time <= times[k]:
        return values[k]
    fraction = (time - times[k]) / (times[k + 1] - times[k])
    return (1.0 - fraction) * values[k] + fraction * values[k + 1]
