"""Exports as other software's own libraries read them: of each format, all meshes of a level in one form."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np
import pytest
import trimesh

from pdvol.store.reader import Run
from pdvol.studio.export.usd import export

Z_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])  # from y upward


@dataclass
class Seen:
    """A mesh: `points` (k, n, 3) [m] at `times` (k,) [s], one without a time where it rests; corners of its polygons,
    all of one size (f, c); `velocities` (k, n, 3) [m/s] where the format has them.
    """

    times: np.ndarray
    points: np.ndarray
    corners: np.ndarray
    velocities: np.ndarray | None = None


def opened(path: Path, level: int):
    """The stage of a USD file with one of its levels."""
    Usd = pytest.importorskip("pxr.Usd", reason="usd-core is an optional extra")
    stage = Usd.Stage.Open(str(path))
    stage.GetDefaultPrim().GetVariantSet("level").SetVariantSelection(f"level_{level}")
    return stage


def write_usd(run: Run, levels: Sequence[int], out: Path, fps: float | None = None, fields=None) -> Path:
    """The USD file of levels of a run, with these fields."""
    return export(run, levels, out, fields, fps, fields is not None)[0]


def read_usd(written: Sequence[Path], level: int, fps: float | None, flat: bool) -> dict[str, Seen]:
    """By OpenUSD."""
    stage = opened(written[0], level)
    from pxr import UsdGeom

    found = {}
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            mesh = UsdGeom.Mesh(prim)
            points, counts = mesh.GetPointsAttr(), mesh.GetFaceVertexCountsAttr().Get()
            codes = points.GetTimeSamples()
            speeds = [mesh.GetVelocitiesAttr().Get(code) for code in codes]
            found[prim.GetName()] = Seen(
                np.array(codes) / stage.GetTimeCodesPerSecond(),
                np.array([points.Get(code) for code in codes] or [points.Get()]),
                np.array(mesh.GetFaceVertexIndicesAttr().Get()).reshape(len(counts), -1),
                np.array(speeds) if codes else None,
            )
    return found


def read_pc2(written: Sequence[Path], level: int, fps: float | None, flat: bool) -> dict[str, Seen]:
    """The header of PC2 by its description, OBJ by meshio."""
    found = {}
    for file in written[level].glob("*.obj"):
        mesh, cache = meshio.read(file), file.with_suffix(".pc2")
        (block,) = mesh.cells
        found[file.stem] = Seen(np.zeros(0), mesh.points[None], block.data)
        if cache.exists():
            data = cache.read_bytes()
            name, version, points, first, rate, frames = struct.unpack_from("<12siiffi", data)
            assert (name, version, first, rate) == (b"POINTCACHE2\0", 1, 0.0, 1.0)
            assert len(data) == 32 + 12 * points * frames and points == len(mesh.points)
            found[file.stem].points = np.frombuffer(data, "<f4", offset=32).reshape(frames, points, 3)
            found[file.stem].times = np.arange(frames) / (fps or 24.0)
    return found


def read_alembic(written: Sequence[Path], level: int, fps: float | None, flat: bool) -> dict[str, Seen]:
    """By Alembic's library; faces are clockwise there, and y is upward."""
    Abc = pytest.importorskip("alembic3d.Abc", reason="alembic3d is an optional extra")
    from alembic3d.AbcGeom import IPolyMesh

    found = {}
    top, turn = Abc.IArchive(str(written[level])).getTop(), np.eye(3) if flat else Z_UP
    for place in (top.getChild(i) for i in range(top.getNumChildren())):
        schema = IPolyMesh(place, place.getChild(0).getName()).getSchema()
        count, sampling = schema.getNumSamples(), schema.getTimeSampling()
        held = (schema.getPositionsProperty(), *([schema.getVelocitiesProperty()] if count > 1 else []))
        points, *speeds = (
            np.array([[tuple(v) for v in values.getValue(k)] for k in range(count)]) @ turn for values in held
        )
        value = schema.getValue(0)
        found[place.getName()] = Seen(
            np.array([sampling.getSampleTime(k) for k in range(count)]) if count > 1 else np.zeros(0),
            points,
            np.array(list(value.getFaceIndices())).reshape(len(value.getFaceCounts()), -1)[:, ::-1],
            speeds[0] if speeds else None,
        )
    return found


def read_obj(written: Sequence[Path], level: int, fps: float | None, flat: bool) -> dict[str, Seen]:
    """By trimesh; a file has no time."""
    states = [
        trimesh.load(file, split_object=True, group_material=False, process=False)
        for file in sorted(written[level].glob("*.obj"))
    ]
    # trimesh names what it has split by the first object of all; materials have the names of their objects.
    named = [{mesh.visual.material.name: mesh for mesh in state.geometry.values()} for state in states]
    return {
        name: Seen(np.zeros(0), np.array([state[name].vertices for state in named]), np.array(mesh.faces))
        for name, mesh in named[0].items()
    }


def read_xdmf(written: Sequence[Path], level: int, fps: float | None, flat: bool) -> dict[str, Seen]:
    """By meshio: the cells of each body."""
    with meshio.xdmf.TimeSeriesReader(written[level]) as reader:
        rest, (cells,) = reader.read_points_cells()
        rest = np.pad(rest, ((0, 0), (0, 3 - rest.shape[1])))
        states = [reader.read_data(step) for step in range(reader.num_steps)]
    times, points, fields = zip(*states, strict=True)
    places = np.array([rest + point["displacement"] for point in points])
    speeds = np.array([point["velocity"] for point in points])
    bodies = fields[0]["body"][0]
    return {
        name: Seen(np.array(times), places, cells.data[bodies == body], speeds)
        for body, name in enumerate(("left", "right"))
    }


READERS = {"usd": read_usd, "pc2": read_pc2, "alembic": read_alembic, "obj": read_obj, "xdmf": read_xdmf}
