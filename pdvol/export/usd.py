"""Moving surfaces as one USD file: the levels are variants of one prim, and each body is a mesh of its own."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdvol.errors import InputError, SimulationError
from pdvol.export.body_surfaces import body_surfaces
from pdvol.export.series import LevelFields, Series, padded
from pdvol.store.files import TEMPORARY
from pdvol.store.reader import Run

LONGEST_USD_REASON = 160  # characters of USD's own message that fit into one line


def export(run: Run, levels: Sequence[int], out: Path, fields: LevelFields) -> list[Path]:
    """Write all levels into `out/<run>.usdc`, without fields. See `pdvol.export`."""
    return [write_usd(run, levels, out / f"{run.path.resolve().name}.usdc")]


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
            for name, surface in body_surfaces(run, series.level):
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
    except SimulationError:
        raise
    except OSError as error:
        raise SimulationError(f"cannot write {path}: {error.strerror}") from error
    except Exception as error:  # Tf.ErrorException
        reason = " ".join(str(error).split())[:LONGEST_USD_REASON]
        raise SimulationError(f"cannot write {path}: {reason}") from error
    finally:
        aside.unlink(missing_ok=True)
    return path
