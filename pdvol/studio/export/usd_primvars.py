"""What USD meshes carry: arrays at time codes, and normals, fields and texture coordinates as primvars."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from pdvol.store.reader import RunLevel
from pdvol.store.series import Fields, in_3d
from pdvol.studio.export.frames import Frame
from pdvol.studio.export.normals import CornerNormals
from pdvol.studio.export.parts import Part


def set_array(attribute: Any, values: np.ndarray, code: float | None = None) -> int:
    """Set an attribute or a primvar to values (n,), (n, 2) or (n, 3) in float32, at a time code, or for all times; the
    bytes of the sample.
    """
    from pxr import Vt

    values = values.astype(np.float32)
    kind = Vt.FloatArray if values.ndim == 1 else getattr(Vt, f"Vec{values.shape[1]}fArray")
    attribute.Set(kind.FromNumpy(values), *(() if code is None else (code,)))
    return int(values.nbytes)


def add_primvar(
    mesh: Any, name: str, kind: str, by: str, values: np.ndarray, code: float | None = None, index: Any = None
) -> int:
    """Set a primvar at a time code, or for all times; `index` are the numbers of the values, of each place that has
    one. The bytes of the sample.
    """
    from pxr import Sdf, UsdGeom, Vt

    primvar = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar(name, getattr(Sdf.ValueTypeNames, kind), by)
    if index is not None and not primvar.IsIndexed():
        primvar.SetIndices(Vt.IntArray.FromNumpy(index.astype(np.int32)))
    return set_array(primvar, values, code)


def add_normals(mesh: Any, normals: CornerNormals, points: np.ndarray, code: float | None = None) -> int:
    """Set normals, the vertices at `points` (n, 3) [m], at a time code, or for all times; the bytes of the sample."""
    return add_primvar(mesh, "normals", "Normal3fArray", "faceVarying", normals.at(points), code, normals.index)


def add_uvs(mesh: Any, part: Part) -> None:
    """The texture coordinates of a render mesh: by vertex, or by corner where a vertex has several (a seam)."""
    render = part.render
    if render is None or not len(render.uvs):
        return
    index, by = np.zeros(len(part.rest), dtype=np.int64), "vertex"
    index[part.corners] = render.uv_corners
    if (index[part.corners] != render.uv_corners).any():
        index, by = render.uv_corners, "faceVarying"
    add_primvar(mesh, "st", "TexCoord2fArray", by, render.uvs, index=index)


def fields_adder(level: RunLevel, bodies: Sequence[tuple[Part, Any]], more: Fields) -> Callable[[Frame], int]:
    """What adds fields to bodies at a frame: those of vertices by vertex, those of cells by face, which shows the cell
    behind it; it returns the bytes of these samples.
    """
    flat = level.rest.shape[1] == 2
    owners = level.mesh.point_bodies[(level.cells if flat else level.surface)[:, 0]]
    cells = np.arange(len(level.cells)) if flat else level.mesh.boundary_cells
    at = lru_cache(maxsize=2)(more)  # of the two steps that a frame lies between

    def add(frame: Frame) -> int:
        size = 0
        for part, mesh in bodies:
            kinds = (("points", "vertex", part.vertices), ("cells", "uniform", cells[owners == part.body]))
            for kind, by, rows in kinds:
                for name in getattr(at(frame.step), kind):
                    values = frame.sampled(lambda step: _finite(getattr(at(step), kind)[name])[rows])  # noqa: B023
                    values, form = (values, "FloatArray") if values.ndim == 1 else (in_3d(values), "Vector3fArray")
                    size += add_primvar(mesh, name, form, by, values, frame.code)
        return size

    return add


def _finite(values: np.ndarray) -> np.ndarray:
    """Without the numbers that no barrier has kept finite: shaders cannot show them."""
    return np.where(np.isfinite(values), values, 0.0)
