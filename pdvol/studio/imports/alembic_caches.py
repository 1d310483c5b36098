"""Alembic files: meshes, and the places of what they hang on.

Positions and places may be sampled at times of their own. Between samples both are interpolated evenly. Alembic has no
units, and corners go clockwise around a face as seen from outside.
"""

from collections.abc import Iterable, Iterator
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.meshing.losses import counted

NO_MESHES = (["Points"], ["Curve"], ["NuPatch"])  # kinds of shapes that are no meshes
TIME_DIGITS = 9  # of times in seconds: samples of two objects at the same time may differ by rounding


class AlembicFile:
    """An open Alembic file, a `SceneFile`. Times are in seconds."""

    unit, rate = "{:g} s", 1.0

    def __init__(self, path: Path):
        from alembic3d.Abc import IArchive
        from alembic3d.AbcGeom import IPolyMesh, ISubD

        self._path, self._archive = path, IArchive(str(path))  # its objects do not keep it
        everything = list(_things(self._archive.getTop()))
        self._meshes = {
            thing.getFullName(): (thing, kind)
            for thing in everything
            for kind in (IPolyMesh, ISubD)
            if kind.matches(thing.getHeader())
        }
        others = ((thing.getMetaData().get("schema").split("_"), thing.getFullName()) for thing in everything)
        left = [f"{schema[1]} {name}" for schema, name in others if schema[1:2] in NO_MESHES]
        self.lost = counted("shapes left out, which are no meshes", left)
        self.names = list(self._meshes)
        self._read: dict[str, list[tuple[np.ndarray, Any]]] = {}

    def _schema(self, name: str) -> Any:
        thing, kind = self._meshes[name]
        return kind(thing.getParent(), thing.getName()).getSchema()

    def _tracks(self, name: str) -> list[tuple[np.ndarray, Any]]:
        """Times (k,) [s] and values of a mesh's points, then of the matrices of what it hangs on, the nearest first."""
        if name not in self._read:
            positions = self._schema(name).getPositionsProperty()
            times = _times(positions, 1 if positions.isConstant() else positions.getNumSamples())
            samples = [np.array(memoryview(positions.getValue(i))).reshape(-1, 3) for i in range(len(times))]
            if not samples:
                raise InputError(f"{self._path}: the mesh {name} has no points")
            self._read[name] = [(times, samples), *_places(self._meshes[name][0])]
        return self._read[name]

    def drawn(self, name: str) -> bool:
        """Whether neither it nor what it hangs on is hidden."""
        from alembic3d.Abc import ISampleSelector
        from alembic3d.AbcGeom import IsAncestorInvisible

        return not IsAncestorInvisible(self._meshes[name][0], ISampleSelector(0))

    def times(self, name: str) -> Iterable[float]:
        """In seconds."""
        moving = [times for times, _ in self._tracks(name) if len(times) > 1]
        return set(np.concatenate(moving).tolist()) if moving else ()

    def points(self, name: str, time: float | None) -> np.ndarray:
        """Lengths count as metres."""
        matrix = self._matrix(name, time)
        return _between(*self._tracks(name)[0], time) @ matrix[:3, :3] + matrix[3, :3]

    def _matrix(self, name: str, time: float | None) -> np.ndarray:
        return reduce(np.matmul, [_between(*place, time) for place in self._tracks(name)[1:]], np.eye(4))

    def faces(self, name: str) -> tuple[np.ndarray, np.ndarray, bool]:
        """Of a mirrored mesh the corners go the other way round."""
        schema = self._schema(name)
        counts, corners = (
            np.array(memoryview(found.getValue(0)), dtype=np.int64)
            for found in (schema.getFaceCountsProperty(), schema.getFaceIndicesProperty())
        )
        return counts, corners, bool(np.linalg.det(self._matrix(name, None)[:3, :3]) >= 0.0)

    def groups(self, name: str) -> Iterable[str]:
        """Sets of faces."""
        return [str(group) for group in self._schema(name).getFaceSetNames()]


def _things(top: Any) -> Iterator[Any]:
    """All objects below one."""
    waiting = [top]
    while waiting:
        thing = waiting.pop()
        yield thing
        waiting += [thing.getChild(i) for i in reversed(range(thing.getNumChildren()))]


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
    """(count,) [s]: when a property or a schema is sampled, rounded."""
    sampling = sampled.getTimeSampling()
    return np.array([sampling.getSampleTime(number) for number in range(count)]).round(TIME_DIGITS)


def _between(times: np.ndarray, values: Any, time: float | None) -> np.ndarray:
    """One of the values at `times`, or what lies evenly between two of one size; the first and the last hold on, and
    the first is that of no time.
    """
    k = 0 if time is None else int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1))
    if k == len(times) - 1 or time is None or time <= times[k] or len(values[k]) != len(values[k + 1]):
        return values[k]
    fraction = (time - times[k]) / (times[k + 1] - times[k])
    return (1.0 - fraction) * values[k] + fraction * values[k + 1]
