"""Reads the animated meshes of USD files: points, the places of what they hang on, and skeletons."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.studio.imports.animated_meshes import AnimatedMesh, chosen_mesh, require_same_count, require_samples


def read_usd(path: Path, prim: str = "", fps: float | None = None) -> tuple[AnimatedMesh, str]:
    """The mesh that `prim` names, or the only one, and how messages name it. `fps` replaces the file's own rate.

    Raises
    ------
    InputError
        The file is damaged, has no such mesh, or its points do not move or change in number; usd-core is missing.
    """
    try:
        from pxr import Tf, Usd, UsdGeom
    except ImportError as error:
        raise InputError("USD files need the package usd-core: pip install usd-core") from error
    try:
        stage = Usd.Stage.Open(str(path))
    except Tf.ErrorException as error:
        raise InputError(f"{path}: unreadable ({str(error).strip().splitlines()[0][:120]}); export it again") from error
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    mesh = meshes[chosen_mesh(path, [str(mesh.GetPath()) for mesh in meshes], prim)]
    where = f"{path}: the mesh {mesh.GetPath()}"
    _bake_skeleton(stage, mesh, where)
    codes = _time_codes(mesh, UsdGeom)
    first = len(mesh.GetPointsAttr().Get(codes[0] if codes else Usd.TimeCode.Default()) or ())
    require_samples(where, first, codes)
    unit = UsdGeom.GetStageMetersPerUnit(stage)
    points = np.empty((len(codes), first, 3))
    for k, code in enumerate(codes):
        local = np.asarray(mesh.GetPointsAttr().Get(code), dtype=np.float64).reshape(-1, 3)
        require_same_count(where, len(local), first, f"time code {code:g}")
        matrix = np.asarray(mesh.ComputeLocalToWorldTransform(code))
        points[k] = unit * (local @ matrix[:3, :3] + matrix[3, :3])
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get(codes[0]) or (), dtype=np.int64)
    corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get(codes[0]) or (), dtype=np.int64)
    rate = fps or stage.GetTimeCodesPerSecond()
    return AnimatedMesh(np.array(codes) / rate, points, counts, corners), where


def _bake_skeleton(stage: Any, mesh: Any, where: str) -> None:
    """Where a skeleton or blend shapes move a mesh, give its points samples, in memory: the file stays as it is."""
    from pxr import Gf, Tf, UsdSkel

    root = UsdSkel.Root.Find(mesh.GetPrim())
    if not root:
        return
    own = stage.GetSessionLayer()
    own.timeCodesPerSecond = stage.GetTimeCodesPerSecond()  # else its samples are stretched to the file's rate
    stage.SetEditTarget(own)
    try:
        baked = UsdSkel.BakeSkinning(root, Gf.Interval.GetFullInterval())
    except Tf.ErrorException as error:
        baked = False
        reason = f" ({str(error).strip().splitlines()[-1].strip()[:120]})"
    else:
        reason = ""
    if not baked:
        raise InputError(f"{where}: its skeleton cannot be evaluated{reason}; export it with baked points")


def _time_codes(mesh: Any, geometry: Any) -> list[float]:
    """The time codes at which a mesh's points, or its place or that of a prim above it, are given."""
    codes: set[float] = set(mesh.GetPointsAttr().GetTimeSamples())
    prim, above = mesh.GetPrim(), True
    while above and prim:
        placed = geometry.Xformable(prim)
        samples: Iterable[float] = placed.GetTimeSamples() if placed else ()
        codes |= set(samples)
        above = not (placed and placed.GetResetXformStack())
        prim = prim.GetParent()
    return sorted(codes)
