"""Alembic caches: one file a level, with a mesh for each body and obstacle, for Blender, Maya and Houdini.

    /<name>/<name>Shape   points and normals of corners in every frame; faces and texture coordinates once

Alembic's conventions hold: y is upward, corners go clockwise around a face as seen from outside, and times are seconds.
Alembic has neither materials nor units; metres are written.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.store.reader import Run
from pdvol.store.series import LevelFields
from pdvol.studio.export.files import written_aside
from pdvol.studio.export.frames import FILM_RATE, Frame, Track, even_frames, points_and_velocities, said
from pdvol.studio.export.normals import CornerNormals
from pdvol.studio.export.parts import RENDER, Part, body_parts, obstacle_parts
from pdvol.studio.shown import upward_in_3d


def export(
    run: Run, levels: Sequence[int], out: Path, fields: LevelFields, fps: float | None = None, surface: str = RENDER
) -> list[Path]:
    """Write `out/level_<l>.abc` for each level: every state, or `fps` frames a second. See `pdvol.studio.export`."""
    try:
        import alembic3d.Abc
    except ImportError as error:
        raise InputError("Alembic files need the package alembic3d: pip install alembic3d; PC2 needs none") from error
    rate = 1.0 / run.dt if fps is None else fps
    paths = [out / f"level_{level}.abc" for level in levels]
    for level, path in zip((run.levels[level] for level in levels), paths, strict=True):
        stored = [Frame(k, k, 1.0) for k in range(level.steps)]
        frames = stored if fps is None else even_frames(level.steps, run.dt, fps)
        parts = [*body_parts(run, level, surface), *obstacle_parts(run, level)]
        samples = sum(len(part.rest) * (len(frames) if part.moves else 1) for part in parts)
        with written_aside(path, 60 * samples + 12 * sum(len(part.corners) for part in parts)) as aside:
            title = f"{run.path.name}, level {level.index}"
            archive = alembic3d.Abc.CreateArchiveWithInfo(str(aside), float(fps or FILM_RATE), "pdvol", title)
            tracks = [points_and_velocities(frames, part.at, rate) for part in parts]
            _write_parts(archive, parts, tracks, said(f"level {level.index}", frames), rate, _y_up(upward_in_3d(run)))
            del archive  # which writes the file
    return paths


def _y_up(up: np.ndarray) -> np.ndarray:
    """(3, 3), orthogonal: takes the axis nearest to `up` to y."""
    axis = int(np.argmax(np.abs(up)))
    y = np.sign(up[axis]) * np.eye(3)[axis]
    x = np.eye(3)[1 if axis == 0 else 0]
    return np.array([x, y, np.cross(x, y)])


def _write_parts(
    archive: Any, parts: Sequence[Part], tracks: Sequence[Track], shown: Iterable, rate: float, turn: np.ndarray
) -> None:
    import imath
    from alembic3d.AbcCoreAbstract import TimeSampling
    from alembic3d.AbcGeom import GeometryScope, ON3fGeomParamSample, OPolyMesh, OPolyMeshSchemaSample, OXform
    from alembic3d.AbcGeom import OV2fGeomParamSample as UVs

    def placed(points: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(points @ turn.T, dtype=np.float32)

    def numbered(index: np.ndarray) -> Any:
        return imath.UnsignedIntArray(imath.DoubleArrayFromBuffer(index.astype(float)))  # it takes no integers

    times = archive.addTimeSampling(TimeSampling(1.0 / rate, 0.0))
    meshes = []
    for part, track in zip(parts, tracks, strict=True):
        place = OXform(archive.getTop(), part.name)
        schema = OPolyMesh(place, f"{part.name}Shape", times).getSchema()
        clockwise = np.concatenate(
            [c[::-1] for c in np.split(np.arange(len(part.corners)), np.cumsum(part.counts)[:-1])]
        )
        normals = CornerNormals(part)
        corners = part.corners[clockwise].astype(np.int32)
        uvs, render = None, part.render
        if render is not None and len(render.uvs):
            uvs = np.ascontiguousarray(render.uvs, dtype=np.float32), numbered(render.uv_corners[clockwise])
        numbers = numbered(normals.index[clockwise])
        meshes.append((part.moves, schema, track, corners, part.counts.astype(np.int32), normals, numbers, uvs))
    for number, _ in enumerate(shown):
        for moves, schema, track, corners, counts, normals, numbers, uvs in meshes:
            if number and not moves:
                continue
            # The arrays that a sample refers to live until it is written.
            at, along = next(track)
            points, velocities = placed(at), None if along is None else placed(along)
            vectors = placed(normals.at(at))
            sample = OPolyMeshSchemaSample(
                imath.V3fArrayFromBuffer(points), imath.IntArrayFromBuffer(corners), imath.IntArrayFromBuffer(counts)
            )
            if velocities is not None and moves:
                sample.setVelocities(imath.V3fArrayFromBuffer(velocities))
            scope = GeometryScope.kFacevaryingScope
            sample.setNormals(ON3fGeomParamSample(imath.V3fArrayFromBuffer(vectors), numbers, scope))
            if uvs is not None and not number:
                sample.setUVs(UVs(imath.V2fArrayFromBuffer(uvs[0]), uvs[1], scope))
            schema.set(sample)
