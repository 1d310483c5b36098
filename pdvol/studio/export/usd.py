"""A shot as one USD file: levels are variants of one prim, and bodies and obstacles are meshes with materials.

    /run                    variant set `level`; the finest level is chosen
    /run/bodies/<name>      a mesh in each variant: points, velocities until the next time code, extent; primvars
                            `rest`, `normals` by corner and, if wanted, fields
    /run/obstacles/<name>   a mesh; one that moves is in each variant, because contact may hold it back on some levels
    /run/materials/<name>   UsdPreviewSurface, bound to the mesh of that name

Units are metres and seconds. Time codes are frames.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pdvol.errors import InputError
from pdvol.store.reader import Run, RunLevel
from pdvol.store.series import LevelFields, with_strain
from pdvol.studio.export.files import copy_texture
from pdvol.studio.export.frames import FILM_RATE, Frame, even_frames, points_and_velocities, said, stored_frames
from pdvol.studio.export.normals import CornerNormals
from pdvol.studio.export.parts import BOTH, RENDER, Part, body_parts, obstacle_parts
from pdvol.studio.export.usd_file import UsdFile, usd_file
from pdvol.studio.export.usd_primvars import add_normals, add_primvar, add_uvs, fields_adder, set_array
from pdvol.studio.shown import linear_colour, upward_in_3d

ROUGHNESS = 0.55  # of all materials, between 0 (a mirror) and 1: the soft highlights of pdvol's pictures


def export(
    run: Run,
    levels: Sequence[int],
    out: Path,
    fields: LevelFields,
    fps: float | None = None,
    with_fields: bool = False,
    surface: str = RENDER,
) -> list[Path]:
    """Write all levels into `out/<run>.usdc`. See `pdvol.studio.export`.

    Without `fps` every stored state has a time code, 24 a second: states are exact, and play at real speed. Fields of
    vertices are primvars by vertex, those of cells by face; render meshes have none. Where both surfaces are written
    the render mesh has the purpose "render", the simulated one "proxy".
    """
    try:
        import pxr.Usd  # noqa: F401
    except ImportError as error:
        raise InputError("USD files need the package usd-core: pip install usd-core") from error
    path, chosen = out / f"{run.path.resolve().name}.usdc", [run.levels[level] for level in sorted(levels)]
    more = with_strain(run, fields) if with_fields else None
    frames = [
        stored_frames(level.steps, run.dt) if fps is None else even_frames(level.steps, run.dt, fps) for level in chosen
    ]
    rate, last = FILM_RATE if fps is None else fps, max(codes[-1].code for codes in frames)
    with usd_file(path) as file:
        root = _add_root(file.stage, run, rate, last)
        coarsest = chosen[0]
        for part in [*body_parts(run, coarsest, surface), *obstacle_parts(run, coarsest)]:
            _add_material(file.stage, part, copy_texture(part, path.with_name(f"{path.stem}_textures")))
            if not part.moves:
                mesh = _add_mesh(file.stage, part)
                _set_points(mesh, part.rest)
                add_normals(mesh, CornerNormals(part), part.rest)
        variants = root.GetPrim().GetVariantSets().AddVariantSet("level")
        for level, codes in zip(chosen, frames, strict=True):
            variants.AddVariant(f"level_{level.index}")
            variants.SetVariantSelection(f"level_{level.index}")
            with variants.GetVariantEditContext():
                _add_level(file, run, level, codes, rate, more, surface)
    return [path]


def _add_level(
    file: UsdFile,
    run: Run,
    level: RunLevel,
    frames: Sequence[Frame],
    rate: float,
    fields: LevelFields | None,
    surface: str,
) -> None:
    """All that moves, frame by frame, into the variant that is being edited."""
    bodies = [(part, _add_mesh(file.stage, part)) for part in body_parts(run, level, surface)]
    for part, mesh in bodies:
        add_primvar(mesh, "rest", "Point3fArray", "vertex", part.rest)
        if part.render is not None:
            add_uvs(mesh, part)
    if surface == BOTH:
        _set_purposes(bodies)
    obstacles = [(part, _add_mesh(file.stage, part)) for part in obstacle_parts(run, level) if part.moves]
    moving = [
        (mesh, CornerNormals(part), points_and_velocities(frames, part.at, rate))
        for part, mesh in [*bodies, *obstacles]
    ]
    simulated = [(part, mesh) for part, mesh in bodies if part.render is None]
    add_fields = fields_adder(level, simulated, fields(level.index)) if fields else None
    for frame in said(f"level {level.index}", frames):
        for mesh, normals, track in moving:
            points, velocities = next(track)
            size = _set_points(mesh, points, velocities, frame.code)
            file.added(size + add_normals(mesh, normals, points, frame.code))
        if add_fields:
            file.added(add_fields(frame))


def _add_root(stage: Any, run: Run, rate: float, last: float) -> Any:
    """The prim of the run, with units, rate, last time code and direction upward."""
    from pxr import Gf, UsdGeom

    root = UsdGeom.Xform.Define(stage, "/run")
    stage.SetDefaultPrim(root.GetPrim())
    for folder in ("bodies", "obstacles", "materials"):
        UsdGeom.Scope.Define(stage, f"/run/{folder}")
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetTimeCodesPerSecond(rate)
    stage.SetFramesPerSecond(rate)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(last)
    up = upward_in_3d(run)
    axis = int(np.argmax(np.abs(up)))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z if axis == 2 else UsdGeom.Tokens.y)
    if axis == 0 or up[axis] < 0:  # USD knows y and z alone as directions upward
        turn = Gf.Rotation(Gf.Vec3d(*map(float, np.sign(up[axis]) * np.eye(3)[axis])), Gf.Vec3d(0, *_USD_UP[axis]))
        root.AddTransformOp().Set(Gf.Matrix4d(turn, Gf.Vec3d(0)))
    return root


_USD_UP = {0: (1, 0), 1: (1, 0), 2: (0, 1)}  # y and z of the upward direction, by the axis that the run's is nearest to


def _place(part: Part) -> str:
    return f"/run/{'obstacles' if part.body is None else 'bodies'}/{part.name}"


def _add_material(stage: Any, part: Part, texture: str) -> None:
    """A material of the part's colour or, where it has one, its texture, by the path from the file."""
    from pxr import Gf, Sdf, UsdShade

    types = Sdf.ValueTypeNames

    def shader(name: str, kind: str, **inputs: tuple[Any, Any]) -> Any:
        made = UsdShade.Shader.Define(stage, f"/run/materials/{part.name}/{name}")
        made.CreateIdAttr(kind)
        for key, (type_, value) in inputs.items():
            made.CreateInput(key, type_).Set(value)
        return made

    material = UsdShade.Material.Define(stage, f"/run/materials/{part.name}")
    shown = {"roughness": (types.Float, ROUGHNESS), "opacity": (types.Float, part.opacity)}
    surface = shader("surface", "UsdPreviewSurface", **shown)
    diffuse = surface.CreateInput("diffuseColor", types.Color3f)
    if texture:
        place = shader("place", "UsdPrimvarReader_float2", varname=(types.String, "st"))
        wraps = dict.fromkeys(("wrapS", "wrapT"), (types.Token, "repeat"))
        image = {"file": (types.Asset, Sdf.AssetPath(f"./{texture}")), "sourceColorSpace": (types.Token, "sRGB")}
        picture = shader("texture", "UsdUVTexture", **image, **wraps)
        picture.CreateInput("st", types.Float2).ConnectToSource(place.CreateOutput("result", types.Float2))
        diffuse.ConnectToSource(picture.CreateOutput("rgb", types.Float3))
    else:
        diffuse.Set(Gf.Vec3f(*linear_colour(part.colour)))
    material.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")


def _add_mesh(stage: Any, part: Part) -> Any:
    """The mesh of a part with its material, without points."""
    from pxr import Gf, UsdGeom, UsdShade, Vt

    mesh = UsdGeom.Mesh.Define(stage, _place(part))
    mesh.GetPrim().SetDisplayName(part.label)
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(not part.closed)
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(part.counts.astype(np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(part.corners.astype(np.int32)))
    mesh.CreateDisplayColorAttr([Gf.Vec3f(*linear_colour(part.colour))])
    mesh.CreateDisplayOpacityAttr([part.opacity])
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(
        UsdShade.Material(stage.GetPrimAtPath(f"/run/materials/{part.name}"))
    )
    return mesh


def _set_points(mesh: Any, points: np.ndarray, velocities: np.ndarray | None = None, code: float | None = None) -> int:
    """Points, velocities and extent at a time code, or for all times; the bytes of these samples."""
    size = set_array(mesh.CreatePointsAttr(), points, code)
    set_array(mesh.CreateExtentAttr(), np.array([points.min(axis=0), points.max(axis=0)]), code)
    return size if velocities is None else size + set_array(mesh.CreateVelocitiesAttr(), velocities, code)


def _set_purposes(bodies: Sequence[tuple[Part, Any]]) -> None:
    """Bodies with a render mesh are drawn by it, and stand in for it where that is chosen."""
    for part, mesh in bodies:
        if part.render is not None:
            proxy = next(own for other, own in bodies if other.render is None and other.body == part.body)
            mesh.CreatePurposeAttr("render")
            proxy.CreatePurposeAttr("proxy")
            mesh.CreateProxyPrimRel().SetTargets([proxy.GetPath()])
