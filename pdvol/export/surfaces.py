"""Moving surfaces for animation software: a sequence of OBJ files a level, or one USD file with the levels as variants.

Vertices are those of the boundary (all of a 2D level), once each and in the input's order; each body is a mesh of its
own in USD.
"""

import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.export.series import Series, padded
from pdvol.store.files import TEMPORARY, write_bytes
from pdvol.store.reader import Run, RunLevel


class BodySurface:
    """The part of a level that is drawn of one body.

    Attributes
    ----------
    vertices : (k,) int64
        Of the level, ascending: the input's order.
    faces : (f, 3) int64
        Into `vertices`.
    """

    def __init__(self, level: RunLevel, body: int):
        facets = level.surface if level.rest.shape[1] == 3 else level.cells
        self.vertices, faces = np.unique(facets[level.mesh.point_bodies[facets[:, 0]] == body], return_inverse=True)
        self.faces = faces.reshape(-1, 3)


def _surfaces(run: Run, level: RunLevel) -> list[tuple[str, BodySurface]]:
    """Names that software takes, and surfaces, of all bodies."""
    names = []
    for i, name in enumerate(run.info.get("bodies", [])):
        plain = re.sub(r"[^A-Za-z0-9_]", "_", str(name))[:60] or "body"
        plain = plain if plain[0].isalpha() or plain[0] == "_" else f"_{plain}"
        names.append(f"{plain}_{i}" if plain in names else plain)
    return [(name, BodySurface(level, i)) for i, name in enumerate(names)]


def write_obj(run: Run, level: int, folder: str | Path) -> Path:
    """Export each stored step of one level as `folder/000000.obj`, `000001.obj` ...; each file is written aside and
    renamed.

    Raises
    ------
    InputError
        When the level does not exist or has no state.
    SimulationError
        When the disk cannot be written.
    """
    folder, series = Path(folder), Series(run, level)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SimulationError(f"cannot write {folder}: {error.strerror}") from error
    surfaces = _surfaces(run, series.level)
    # One numbering for all bodies, in the input's order.
    used = np.unique(np.concatenate([surface.vertices for _, surface in surfaces]))
    parts = []
    for name, surface in surfaces:
        corners = np.searchsorted(used, surface.vertices)[surface.faces] + 1
        parts.append("\n".join([f"o {name}", *("f {} {} {}".format(*row) for row in corners.tolist()), ""]))
    for step in range(series.steps):
        points = padded(series.level.positions(step)[used])
        lines = "".join("v {!r} {!r} {!r}\n".format(*row) for row in points.tolist())
        write_bytes(folder / f"{step:06d}.obj", (lines + "".join(parts)).encode())
    return folder


def write_usd(run: Run, levels: Sequence[int], path: str | Path) -> Path:
    """Export levels as one .usdc file: a prim with a variant set `level`, a mesh a body, positions and velocities as
    time samples.

    The finest level is the chosen variant. One time code a step; units are metres and seconds.

    Raises
    ------
    InputError
        When a level does not exist or has no state, or the package usd-core is not installed.
    SimulationError
        When the disk cannot be written.
    """
    try:
        from pxr import Gf, Sdf, Usd, UsdGeom, Vt
    except ImportError as error:
        raise InputError("USD files need the package usd-core: pip install usd-core, or pdvol[usd]") from error
    path, all_series = Path(path), [Series(run, level) for level in levels]
    stage = Usd.Stage.CreateInMemory()
    up = run.info.get("up") or (0.0, 1.0, 0.0)
    UsdGeom.SetStageUpAxis(
        stage, UsdGeom.Tokens.z if len(up) == 3 and abs(up[2]) > max(abs(up[0]), abs(up[1])) else UsdGeom.Tokens.y
    )
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(1.0 / run.dt)
    stage.SetFramesPerSecond(1.0 / run.dt)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(max(series.steps for series in all_series) - 1)
    root = UsdGeom.Xform.Define(stage, "/run").GetPrim()
    stage.SetDefaultPrim(root)
    variants = root.GetVariantSets().AddVariantSet("level")
    for series in all_series:
        variants.AddVariant(f"level_{series.level.index}")
        variants.SetVariantSelection(f"level_{series.level.index}")
        with variants.GetVariantEditContext():
            meshes = []
            for name, surface in _surfaces(run, series.level):
                mesh = UsdGeom.Mesh.Define(stage, Sdf.Path(f"/run/{name}"))
                mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
                mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(surface.faces), 3, np.int32)))
                mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(surface.faces.astype(np.int32).ravel()))
                meshes.append((surface, mesh.CreatePointsAttr(), mesh.CreateVelocitiesAttr(), mesh.CreateExtentAttr()))
            for step in range(series.steps):
                positions, velocities = series.level.positions(step), series.level.velocities(step)
                for surface, points_of, velocities_of, extent_of in meshes:
                    points = padded(positions[surface.vertices]).astype(np.float32)
                    points_of.Set(Vt.Vec3fArray.FromNumpy(points), step)
                    velocities_of.Set(
                        Vt.Vec3fArray.FromNumpy(padded(velocities[surface.vertices]).astype(np.float32)), step
                    )
                    extent_of.Set(
                        [Gf.Vec3f(*map(float, points.min(axis=0))), Gf.Vec3f(*map(float, points.max(axis=0)))], step
                    )
    aside = path.with_name(f".{path.stem}{TEMPORARY}.usdc")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        if not stage.GetRootLayer().Export(str(aside)):
            raise SimulationError(f"cannot write {path}")
        os.replace(aside, path)
    except OSError as error:
        raise SimulationError(f"cannot write {path}: {error.strerror}") from error
    except Exception as error:  # Tf.ErrorException
        told = (
            str(error)
            if isinstance(error, SimulationError)
            else f"cannot write {path}: {' '.join(str(error).split())[:160]}"
        )
        raise SimulationError(told) from error
    finally:
        aside.unlink(missing_ok=True)
    return path
