"""What USD meshes carry beside points: normals, fields, the rest state and texture coordinates, as primvars."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pdvol.store.reader import RunLevel
from pdvol.store.series import Fields, StepFields, in_3d
from pdvol.studio.export.frames import Frame
from pdvol.studio.export.normals import CornerNormals
from pdvol.studio.export.parts import Part


def add_primvar(mesh: Any, name: str, kind: str, by: str, values: np.ndarray, code: float | None = None) -> int:
    """Set a primvar at a time code, or for all times; the bytes of the sample."""
    from pxr import Sdf, UsdGeom, Vt

    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, getattr(Sdf.ValueTypeNames, kind), by)
    values = values.astype(np.float32)
    array = (Vt.FloatArray if values.ndim == 1 else Vt.Vec3fArray).FromNumpy(values)
    primvar.Set(array, *(() if code is None else (code,)))
    return int(values.nbytes)


def add_normals(mesh: Any, normals: CornerNormals, points: np.ndarray, code: float | None = None) -> int:
    """Set normals, the vertices at `points` (n, 3) [m], at a time code, or for all times; the bytes of the sample."""
    from pxr import UsdGeom, Vt

    size = add_primvar(mesh, "normals", "Normal3fArray", "faceVarying", normals.at(points), code)
    primvar = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("normals")
    if not primvar.IsIndexed():
        primvar.SetIndices(Vt.IntArray.FromNumpy(normals.index.astype(np.int32)))
    return size


def add_uvs(mesh: Any, part: Part) -> None:
    """The texture coordinates of a render mesh: by vertex, or by corner where a vertex has several (a seam)."""
    from pxr import Sdf, UsdGeom, Vt

    render = part.render
    if render is None or not len(render.uvs):
        return
    of_vertex = np.zeros(len(part.rest), dtype=np.int64)
    of_vertex[part.corners] = render.uv_corners
    smooth = bool((of_vertex[part.corners] == render.uv_corners).all())
    indices = of_vertex if smooth else render.uv_corners
    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(
        "st", Sdf.ValueTypeNames.TexCoord2fArray, "vertex" if smooth else "faceVarying"
    )
    primvar.Set(Vt.Vec2fArray.FromNumpy(render.uvs.astype(np.float32)))
    primvar.SetIndices(Vt.IntArray.FromNumpy(indices.astype(np.int32)))


def fields_adder(level: RunLevel, bodies: Sequence[tuple[Part, Any]], more: Fields) -> Callable[[Frame], int]:
    """What adds fields to bodies at a frame: those of vertices by vertex, those of cells by face, which shows the cell
    behind it; it returns the bytes of these samples.
    """
    flat = level.rest.shape[1] == 2
    owners = level.mesh.point_bodies[(level.cells if flat else level.surface)[:, 0]]
    cells = np.arange(len(level.cells)) if flat else level.mesh.boundary_cells
    latest: dict[int, StepFields] = {}  # of the two steps that a frame lies between

    def at(step: int) -> StepFields:
        if step not in latest:
            latest[step] = more(step)
            for old in [number for number in latest if number < step - 1]:
                del latest[old]
        return latest[step]

    def add(frame: Frame) -> int:
        size = 0
        for part, mesh in bodies:
            behind = cells[owners == part.body]
            for name in at(frame.step).points:
                values = frame.sampled(lambda step: _finite(at(step).points[name])[part.vertices])  # noqa: B023
                values, kind = (values, "FloatArray") if values.ndim == 1 else (in_3d(values), "Vector3fArray")
                size += add_primvar(mesh, name, kind, "vertex", values, frame.code)
            for name in at(frame.step).cells:
                values = frame.sampled(lambda step: _finite(at(step).cells[name])[behind])  # noqa: B023
                size += add_primvar(mesh, name, "FloatArray", "uniform", values, frame.code)
        return size

    return add


def _finite(values: np.ndarray) -> np.ndarray:
    """Without the numbers that no barrier has kept finite: shaders cannot show them."""
    return np.where(np.isfinite(values), values, 0.0)
